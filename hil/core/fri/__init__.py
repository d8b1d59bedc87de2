"""The FRI link: session, quality, admission, messages."""
