"""Serve every layer: errors in one sentence, atomic writes, untrusted files, signals, progress bars."""
