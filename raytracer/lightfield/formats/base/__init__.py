"""What the formats of light fields share: the record that declares one, arrays read lazily, and rows of large files."""
