"""Pages that stand in the repository's own files: README, CONTRIBUTING, CHANGELOG."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GALLERY = ROOT / "reports" / "gallery"
DOORS = """
<div class="doors" markdown>
- [**Reproduce a published result**](tutorials/reproduce.md) a figure's cells beside the paper's, and how fitted each is
- [**A what-if study**](tutorials/what-if.md) what holds a frame, and what another machine or tile would change
- [**A model of your own**](tutorials/my-model.md) an OBJ file through four rasterizers
- [**How a launch gets its time**](time.md) one picture a mechanism
- [**Is it accurate?**](accuracy.md) every predicted kernel beside the measured one
- [**Questions**](faq.md) my GPU, my trace, Nsight, speed
</div>
"""
FIRST = "Install and reproduce"  # the part of the README that the front page has


def pages() -> dict[str, str | bytes]:
    """The front page, the quick start, the rest of the README's family, and the pictures of the gallery."""
    head, *parts = re.split(r"^## ", (ROOT / "README.md").read_text("utf-8"), flags=re.MULTILINE)
    install = next(part for part in parts if part.startswith(FIRST))
    rest = [part for part in parts if not part.startswith(FIRST)]
    made: dict[str, str | bytes] = {
        "index.md": _linked(f"{head}\n{DOORS}\n## {install}"),
        "quick-start.md": _linked("# Quick start\n\n" + "".join(f"## {part}" for part in rest)),
        "contributing.md": _linked((ROOT / "CONTRIBUTING.md").read_text("utf-8")),
        "changelog.md": _linked((ROOT / "CHANGELOG.md").read_text("utf-8")),
        "gallery.md": _gallery((GALLERY / "README.md").read_text("utf-8")),
    }  # fmt: skip
    return made | {f"gallery/{path.name}": path.read_bytes() for path in sorted(GALLERY.glob("*.png"))}


def _linked(text: str) -> str:
    """Links into docs/ and to the gallery, as the site has them."""
    return text.replace("](docs/", "](").replace("](reports/gallery/", "](gallery/")


def _gallery(text: str) -> str:
    """The gallery's pictures and its links into docs/, as the site has them."""
    return re.sub(r"\]\((?!\.\./)", "](gallery/", text).replace("](../../docs/", "](")
