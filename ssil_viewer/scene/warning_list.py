"""Collects what a loader could not honour, each kind once, so that a thousand nodes give one sentence."""

from __future__ import annotations

MAX_NAMED = 3
"""Items that a warning names before it only counts the rest."""


def printable(text: str, limit: int = 80) -> str:
    """Text from a file made safe for a terminal: one line, no control characters, not longer than `limit`."""
    clean = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return clean if len(clean) <= limit else clean[: limit - 3] + "..."


class WarningList:
    """Warnings in the order in which their kinds first came up."""

    def __init__(self) -> None:
        self._items: dict[str, dict[str, int]] = {}

    def add(self, message: str, item: str = "", count: int = 1) -> None:
        """Notes a problem.

        Args:
            message: A sentence without full stop, the same for each occurrence of the kind.
            item: What it concerns: a file, a material, a node.
            count: How many times, for a problem found by array arithmetic.
        """
        items = self._items.setdefault(printable(message, 400), {})
        key = printable(item, 120)
        items[key] = items.get(key, 0) + count

    def note(self, message: str) -> None:
        """Makes sure that a kind of problem is listed, without counting another occurrence."""
        self._items.setdefault(printable(message, 400), {})

    def extend(self, other: WarningList) -> None:
        """Takes over the warnings of another list."""
        for message, items in other._items.items():
            self.note(message)
            for item, count in items.items():
                self.add(message, item, count)

    def __bool__(self) -> bool:
        return bool(self._items)

    def sentences(self) -> tuple[str, ...]:
        """One sentence for each kind: the message, the first items, and how many there were."""
        return tuple(self._sentence(message, items) for message, items in self._items.items())

    @staticmethod
    def _sentence(message: str, items: dict[str, int]) -> str:
        named = [item for item in items if item]
        total = sum(items.values())
        if named:
            message += ": " + ", ".join(named[:MAX_NAMED])
            if len(named) > MAX_NAMED:
                message += f" and {len(named) - MAX_NAMED} more"
        return message if total <= max(1, len(named)) else f"{message} ({total} in all)"
