"""What viewers received: checks of one viewer's messages, counts that can be summed across viewers and worker
processes, and the verdict on them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields

from posecast_wire.decoder import Decoder
from posecast_wire.frame import FrameError, frame_id, parse_header

# lateness buckets: upper edges in ms, about 12 % apart, so a percentile is off by at most that
_EDGES_MS = tuple(round(1.12**power, 3) for power in range(100))


@dataclass
class Tally:
    """The counts of one process. All members can be summed; `counts` and `sum` pass them between
    processes."""

    viewers: int = 0
    refused: int = 0
    closed: int = 0
    frames: int = 0
    missed: int = 0
    duplicates: int = 0
    reordered: int = 0
    undecodable: int = 0
    lowered: int = 0  # how often the relay lowered a viewer's rate
    evicted: int = 0  # frozen viewers that the relay cut, as it should
    unevicted: int = 0  # frozen viewers that were still connected when they read again
    slow_frames: int = 0  # frames to slow viewers; not in other counts of frames
    slow_viewers: int = 0
    slow_starved: int = 0  # slow viewers that got no frame during a whole connection
    workers_lost: int = 0  # lost processes: their viewers count up to their last report
    rate_sum_hz: float = 0.0
    rate_square_sum: float = 0.0
    buckets: list[int] = field(default_factory=lambda: [0] * (len(_EDGES_MS) + 1))

    def frame(self, lateness_s: float) -> None:
        """Count a frame that arrived this late."""
        self.frames += 1
        self.buckets[bisect_left(_EDGES_MS, lateness_s * 1000)] += 1

    def viewer(self, rate_hz: float) -> None:
        """Count a viewer that ended after getting `rate_hz` frames per second on average."""
        self.viewers += 1
        self.rate_sum_hz += rate_hz
        self.rate_square_sum += rate_hz * rate_hz

    def clear(self) -> None:
        """Reset all counts."""
        self.__dict__.update(Tally().__dict__)

    def percentile_ms(self, share: float) -> float:
        """Return the percentile of lateness for `share` of the frames, in ms; infinite beyond the last
        bucket."""
        rest = share * self.frames
        for edge, count in zip((*_EDGES_MS, float("inf")), self.buckets, strict=True):
            rest -= count
            if rest <= 0:
                return edge if self.frames else 0.0
        return float("inf")

    @property
    def jain(self) -> float:
        """Jain's fairness index of the viewers' rates, (Σx)² / (n Σx²): 1 when all got the same."""
        if self.rate_square_sum == 0:
            return 0.0
        return self.rate_sum_hz**2 / (self.viewers * self.rate_square_sum)

    def counts(self) -> dict[str, float | list[int]]:
        """Return the counts as plain JSON."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def sum(cls, parts: Iterable[Mapping[str, float | list[int]]]) -> Tally:
        """Add up the `counts` of several processes."""
        total = cls()
        for part in parts:
            for name, value in part.items():
                mine = getattr(total, name)
                if isinstance(value, list):
                    setattr(total, name, [a + b for a, b in zip(mine, value, strict=True)])
                else:
                    setattr(total, name, mine + value)
        return total


@dataclass(frozen=True)
class LoadLimits:
    """The limits of a load test. `p99_ms` applies to the control viewer if there is one."""

    missed_share: float = 0.001
    p99_ms: float = 200.0
    jain: float = 0.99


def breaches(tally: Tally, limits: LoadLimits, control: Tally | None = None) -> list[str]:
    """Return one line for each exceeded limit. `control`: the counts of the viewer in a separate process."""
    found: list[str] = []
    if tally.frames == 0:
        found.append("no viewer got a frame")
    for name in (
        "refused",
        "closed",
        "duplicates",
        "reordered",
        "undecodable",
        "lowered",
        "unevicted",
        "slow_starved",
        "workers_lost",
    ):
        count = getattr(tally, name)
        if count:
            found.append(f"{count} {name.replace('_', ' ')}")
    share = tally.missed / max(1, tally.frames + tally.missed)
    if share > limits.missed_share:
        found.append(f"missed {share:.2%} of the frames, over {limits.missed_share:.2%}")
    if control is not None and control.frames == 0:
        found.append("the control viewer got no frame")
    p99_ms = (control or tally).percentile_ms(0.99)
    if p99_ms > limits.p99_ms:
        found.append(f"p99 lateness {p99_ms:.0f} ms, over {limits.p99_ms:.0f} ms")
    if tally.viewers and tally.jain < limits.jain:
        found.append(f"fairness {tally.jain:.4f}, under {limits.jain:.2f}")
    return found


def report(tally: Tally, limits: LoadLimits, control: Tally | None = None) -> str:
    """Return the report of the test."""

    def late(of: Tally) -> str:
        return f"p50 {of.percentile_ms(0.5):.0f} ms, p99 {of.percentile_ms(0.99):.0f} ms"

    lines = [
        f"viewers      {tally.viewers} healthy ones (refused {tally.refused}, closed early {tally.closed})",
        f"frames       {tally.frames} in all; Locust's table shows every tenth",
        f"missed       {tally.missed}",
        f"duplicates   {tally.duplicates}, out of order {tally.reordered}",
        f"undecodable  {tally.undecodable}",
        f"lateness     {late(tally)}, in the load generator",
    ]
    if control is not None:
        lines.append(f"control      {late(control)}, {control.missed} missed, in a separate process")
    lines.append(f"fairness     {tally.jain:.4f} (Jain)")
    if tally.slow_viewers:
        lines.append(f"slow         {tally.slow_viewers} viewers got {tally.slow_frames} frames")
    if tally.evicted or tally.unevicted:
        lines.append(f"frozen       {tally.evicted} cut by the relay, {tally.unevicted} not")
    found = breaches(tally, limits, control)
    lines += [f"BREACH       {line}" for line in found] or ["all limits kept"]
    return "\n".join(lines)


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
