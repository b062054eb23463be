"""What in a page or a picture could run or be fetched: scripts, handlers, frames, links that are no plain ones."""

from __future__ import annotations

from html.parser import HTMLParser

_ELEMENTS = {"script", "iframe", "object", "embed", "foreignobject", "base", "form", "link", "img", "b"}
_FETCHED = {"src", "href", "xlink:href", "action", "data", "formaction"}


def active_parts(text: str) -> list[str]:
    """In words; nothing of a page that is only looked at."""
    parser = _Active()
    parser.feed(text)
    parser.close()
    return parser.found


class _Active(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in _ELEMENTS:
            self.found.append(f"element {tag}")
        for name, value in attrs:
            if name.startswith("on") or (name in _FETCHED and not (value or "").startswith("#")):
                self.found.append(f"attribute {name}={value!r:.80}")
