"""The operator's token: who has it may act, who has it not may look."""

import hmac
import secrets
from typing import Final

from hil.values.errors import ConfigurationError

_ALPHABET: Final = "abcdefghjkmnpqrstuvwxyz23456789"
"""Without letters that look like others: it is read from a terminal, and typed."""
_SHORTEST: Final = 12
_LENGTH: Final = 20
"""99 bits."""


def new_token() -> str:
    """Return a token nobody can guess."""
    return "".join(secrets.choice(_ALPHABET) for _ in range(_LENGTH))


def checked_token(text: str) -> str:
    """Return ``text`` as a token; raise :class:`ConfigurationError` where it is too short, or no part of a URL."""
    if len(text) < _SHORTEST or not text.isascii() or not text.isalnum():
        raise ConfigurationError(
            f"the operator's token has {len(text)} characters; at least {_SHORTEST} letters and digits are needed"
        )
    return text


def same_token(given: str, token: str) -> bool:
    """Whether it is the token; takes as long whatever is given."""
    return hmac.compare_digest(given.strip().encode(), token.encode())
