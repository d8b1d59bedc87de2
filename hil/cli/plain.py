"""Texts from elsewhere on the terminal."""

from rich.markup import escape


def plain(text: str) -> str:
    """Show what a file or a peer says as it is: neither markup of ours nor orders to the terminal."""
    return escape("".join(one if one.isprintable() else "\N{REPLACEMENT CHARACTER}" for one in text))
