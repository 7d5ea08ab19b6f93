"""Link from pages of the reference, docs/reference/PART/PAGE.md, to the documents of docs/."""

import re
from pathlib import Path

DOCS = Path(__file__).parent


def link(document: str) -> str:
    """Write a link to a document, such as `lecture/03-pinhole.md`, by its title."""
    text = (DOCS / document).read_text(encoding="utf-8")
    title = next(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# "))
    return f"[{title}](../../{document})"


def with_links(text: str) -> str:
    """Put links where a text names documents: `docs/aovs.md`."""
    return re.sub(r"docs/([\w/-]+\.md)", lambda found: link(found[1]), text)
