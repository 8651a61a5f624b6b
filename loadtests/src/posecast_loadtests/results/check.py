"""Checks what one viewer received: sequence numbers, KEYs, lateness."""

from __future__ import annotations

from posecast_wire.decoder import Decoder
from posecast_wire.frame import FrameError, frame_id, parse_header

from posecast_loadtests.results.tally import Tally


class Clock:
    """Compares robot time with this machine's. Lateness is how much longer a frame took than the fastest one.

    There is one per process and robot, so that a viewer that is always late shows as late.
    """

    def __init__(self) -> None:
        self._quickest_s = float("inf")

    def lateness_s(self, arrival_s: float, t_s: float) -> float:
        """Seconds above the smallest `arrival - t` seen so far."""
        offset_s = arrival_s - t_s
        self._quickest_s = min(self._quickest_s, offset_s)
        return offset_s - self._quickest_s


class Viewer:
    """Checks one viewer's messages. `step`: the number of robot frames per viewer frame."""

    def __init__(self, tally: Tally, clock: Clock, step: int, decode: bool) -> None:
        self._tally = tally
        self._clock = clock
        self._step = step
        self._decodes = decode
        self.frames = 0
        self.connected()

    def connected(self) -> None:
        """Note a new connection, which starts without a KEY."""
        self._decoder = Decoder() if self._decodes else None
        self._key: tuple[int, int, float] | None = None  # the newest KEY's id, seq, t
        self._seq: int | None = None
        self._ahead: tuple[float, float] | None = None  # a KEY's arrival and lateness, until the next message
        self._joined = False
        self.messages = 0

    def paced(self, step: int) -> None:
        """From now on every `step`th robot frame is due, because the relay changed the rate."""
        self._step = step
        self._joined = False

    def schema(self, text: str) -> None:
        """Take a schema message, verbatim."""
        if self._decoder is not None:
            self._decoder.add_schema(text)

    def binary(self, message: bytes, arrival_s: float) -> float | None:
        """Take one frame. Returns its lateness in seconds; None for a KEY sent ahead, or an unusable
        frame."""
        self.messages += 1
        try:
            header = parse_header(message)
            if self._decoder is not None:
                self._decoder.decode(message)
        except FrameError:
            self._tally.undecodable += 1
            return None
        if header.is_key:
            seq, t_s = header.seq, header.t
            self._key = frame_id(message), seq, t_s
            if self._seq is not None and seq < self._seq:
                self._seq = None  # a new run starts its own count
        else:
            if self._key is None or self._key[0] != header.base_id:
                self._tally.undecodable += 1
                return None
            _, key_seq, key_t_s = self._key
            seq, t_s = (key_seq + header.seq) & 0xFFFFFFFF, key_t_s + header.t / 1000
        if not self._in_order(seq):
            return None
        self._joined = self._joined or not header.is_key
        return self._count(arrival_s, self._clock.lateness_s(arrival_s, t_s), header.is_key)

    def _in_order(self, seq: int) -> bool:
        last = self._seq
        if last is not None and seq <= last:
            if seq == last:
                self._tally.duplicates += 1
            else:
                self._tally.reordered += 1
            return False
        # a new viewer gets a KEY that is seconds old, then the newest frame
        if last is not None and self._joined:
            self._tally.missed += max(0, (seq - last) // self._step - 1)
        self._seq = seq
        return True

    def _count(self, arrival_s: float, lateness_s: float, is_key: bool) -> float | None:
        """Count a frame. A KEY sent only for the frame that follows it in the same write does not count."""
        ahead, self._ahead = self._ahead, (arrival_s, lateness_s) if is_key else None
        if ahead is not None and ahead[0] != arrival_s:
            self._frame(ahead[1])
        if is_key:
            return ahead[1] if ahead is not None else None
        self._frame(lateness_s)
        return lateness_s

    def _frame(self, lateness_s: float) -> None:
        self.frames += 1
        self._tally.frame(lateness_s)
