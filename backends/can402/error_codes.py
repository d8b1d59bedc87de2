"""What error codes of drives mean (CiA 301 emergency classes, CiA 402 object 603Fh), in our words."""

from typing import Final

_WORDS: Final = {
    0x2310: "continuous over-current at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "over-voltage of the DC link",
    0x3220: "under-voltage of the DC link",
    0x4110: "too hot around the drive",
    0x4210: "drive too hot",
    0x4310: "power stage too hot",
    0x5113: "control supply failed",
    0x5441: "safe torque off",
    0x6320: "parameters wrong",
    0x7121: "motor blocked",
    0x7305: "incremental encoder 1 failed",
    0x7380: "position sensor failed",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "it misses our heartbeat, or the node guarding",
    0x8140: "it recovered from bus-off",
    0x8611: "following error",
    0x8612: "reference limit reached",
}
_CLASSES: Final = {
    0x2: "current", 0x3: "voltage", 0x4: "temperature", 0x5: "hardware", 0x6: "software", 0x7: "motor or sensor",
    0x8: "monitoring", 0x9: "external", 0xF: "of the maker's own",
}  # fmt: skip


def error_in_words(code: int) -> str:
    """Return ``fault 0x2310 (continuous over-current at the output)``."""
    if code == 0:
        return "fault without a code"
    words = _WORDS.get(code) or _CLASSES.get(code >> 12)
    return f"fault 0x{code:04X}" + (f" ({words})" if words else "")
