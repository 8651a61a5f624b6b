"""As much of MQTT 3.1.1 as one topic at QoS 0 needs (the numbers are its packet types)."""

from __future__ import annotations

TOPIC = b"f"


def text(value: bytes) -> bytes:
    """A string with its length before it."""
    return len(value).to_bytes(2, "big") + value


def packet(first: int, rest: bytes) -> bytes:
    """Any packet: its first byte, the length of the rest in seven bits a byte, the rest."""
    size, length = len(rest), bytearray()
    while True:
        size, low = divmod(size, 128)
        length.append(low | (0x80 if size else 0))
        if not size:
            return bytes([first]) + bytes(length) + rest


def connect() -> bytes:
    """A clean session of no name, which the broker names itself; no keep-alive."""
    return packet(0x10, text(b"MQTT") + bytes([4, 2, 0, 0]) + text(b""))


def subscribe() -> bytes:
    """To the topic, at QoS 0."""
    return packet(0x82, b"\0\1" + text(TOPIC) + b"\0")


def publish(payload: bytes) -> bytes:
    """At QoS 0. What comes before the payload is what a reader must skip."""
    return packet(0x30, text(TOPIC) + payload)
