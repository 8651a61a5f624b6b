"""The past in Redis: its keys, and the Lua scripts that read and write them. Each script is atomic.

    posecast:{ROBOT}:VIEW:past            stream: a record of each segment, as `past/segment.py` packs it
    posecast:{ROBOT}:VIEW:past:TAKE:INDEX hash: a segment's bytes, and the id of its record
    posecast:{ROBOT}:past:schema:SHA256   hash: a schema's text, and how many segments name it
    posecast:{-}:past                     hash: the ledger's sums: robot → bytes; "" → of all
    posecast:{-}:past:ROBOT               sorted set, of the ledger: VIEW TAKE INDEX SCHEMA BYTES →
                                          Redis's clock in ms

A writer enters a segment into the ledger before writing it, so Redis never holds more than the ledger lists.
When space runs out, the ledger drops the oldest segments of the robot that uses the most, and the writer
deletes them. Everything expires with the window. Live state shares only the server with this.
"""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.past.segment import SegmentName
from posecast_relay.redis.client import Call

WRITTEN, LACKS_SCHEMA, FULL = 1, 2, 3
MEMORY_SHARE = 0.75  # of the server's `maxmemory`: beyond it nothing is added, to protect live state
GONE_MAX = 1000  # the most lines that one call drops, so that it never blocks Redis for long
FORGOTTEN_MAX = 250  # the most lines that one call drops of a robot that is forgotten
SPARE = 64  # this fraction (1/64) is freed at the limit, so that not every segment hits it
EXPIRY_SPARE_MS = 60_000  # how much longer keys live than their ledger entries
LOOK_BYTES = 1 << 20  # the most bytes of records in one answer, except for a single record

LEDGER = "posecast:{-}:past"


class LedgerEntry(NamedTuple):
    """A line of the ledger. `schema`: SHA-256 in hexadecimal, or `-`; `bytes`: its size in Redis."""

    name: SegmentName
    schema: str
    bytes: int


def stream_key(robot: str, view: str) -> str:
    """The key of the stream with a view's records."""
    return f"posecast:{{{robot}}}:{view}:past"


def segment_key(name: SegmentName) -> str:
    """The key of the hash with a segment's bytes."""
    return f"{stream_key(name.robot, name.view)}:{name.take:016x}:{name.index}"


def schema_key(robot: str, schema: str) -> str:
    """The key of the hash with a schema's text."""
    return f"posecast:{{{robot}}}:past:schema:{schema}"


def make_enter_call(entries: list[LedgerEntry], window_s: float, bytes_max: int) -> Call:
    """Make the call that enters segments into the ledger.

    It returns whether there is room for them now, followed by what was dropped, as alternating robots and
    lines: see `read_entry`.
    """
    args: list[str | int] = [round(1000 * window_s), bytes_max]
    for entry in entries:
        name = entry.name
        args += [name.robot, f"{name.view} {name.take:016x} {name.index} {entry.schema} {entry.bytes}"]
    return ENTER, [LEDGER], args


def make_forget_call(robot: str, lines: list[bytes]) -> Call:
    """Make the call that removes a robot's lines, whose segments are already deleted, from the ledger.

    It returns the robot's remaining lines, at most FORGOTTEN_MAX.
    """
    return FORGET, [LEDGER], [robot, *lines]


def read_entry(robot: bytes, line: bytes) -> LedgerEntry:
    """Parse a line of the ledger. Raises ValueError if it is invalid."""
    view, take, index, schema, size = line.decode().split(" ")
    return LedgerEntry(SegmentName(robot.decode(), view, int(take, 16), int(index)), schema, int(size))


def make_write_call(entry: LedgerEntry, record: bytes, data: bytes, schema_text: str, expiry_ms: int) -> Call:
    """Make the call that writes a segment. Repeating it is harmless.

    `schema_text`: "" if the schema should already be stored; if it is not, the call returns LACKS_SCHEMA.
    """
    return WRITE, _keys(entry), [record, data, expiry_ms, schema_text]


def make_delete_call(entry: LedgerEntry) -> Call:
    """Make the call that deletes a segment and its record, and its schema if no other names it."""
    return DELETE, _keys(entry), []


def _keys(entry: LedgerEntry) -> list[str]:
    name = entry.name
    keys = [stream_key(name.robot, name.view), segment_key(name)]
    return keys if entry.schema == "-" else [*keys, schema_key(name.robot, entry.schema)]


_READ = """
local function is(key, kind)
  local found = redis.call('TYPE', key).ok
  if found ~= kind and found ~= 'none' then redis.call('DEL', key) return false end
  return found == kind
end
local function now_ms()
  local t = redis.call('TIME')
  return t[1] * 1000 + math.floor(t[2] / 1000)
end
local function text(n) return string.format('%d', n) end
"""

# KEYS: the ledger's sums. ARGV: the window in ms, the limit in bytes, then alternating robots and lines.
# All keys that it touches are in the slot of `{-}`.
ENTER = """
local sums, window, bound, now = KEYS[1], tonumber(ARGV[1]), tonumber(ARGV[2]), now_ms()
local gone = {0}
is(sums, 'hash')
local function left() return math.max(0, {gone} - math.floor(#gone / 2)) end
local function set_of(robot) return sums .. ':' .. robot end
local function list_old(robot)
  return redis.call('ZRANGE', set_of(robot), '-inf', text(now - window), 'BYSCORE', 'LIMIT', 0, text(left()))
end
local function size_of(line) return tonumber(string.match(line, '%d+$') or '0') end
local function take(robot, lines)
  local freed = 0
  for _, line in ipairs(lines) do
    freed = freed + size_of(line)
    redis.call('ZREM', set_of(robot), line)
    gone[#gone + 1] = robot
    gone[#gone + 1] = line
  end
  redis.call('HINCRBY', sums, '', text(-freed))
  return tonumber(redis.call('HINCRBY', sums, robot, text(-freed)))
end
for i = 3, #ARGV, 2 do
  local robot, line = ARGV[i], ARGV[i + 1]
  local sum = tonumber(redis.call('HGET', sums, robot) or '')
  if not is(set_of(robot), 'zset') or not sum then  -- one of the two has expired
    local there = 0
    for _, each in ipairs(redis.call('ZRANGE', set_of(robot), 0, -1)) do there = there + size_of(each) end
    redis.call('HSET', sums, robot, text(there))
    redis.call('HINCRBY', sums, '', text(there - (sum or 0)))
  end
  if redis.call('ZADD', set_of(robot), 'NX', text(now), line) == 1 then
    redis.call('HINCRBY', sums, robot, text(size_of(line)))
    redis.call('HINCRBY', sums, '', text(size_of(line)))
  end
  take(robot, list_old(robot))
  redis.call('PEXPIRE', set_of(robot), window + {spare_ms})
end
redis.call('PEXPIRE', sums, 2 * (window + {spare_ms}))
if tonumber(redis.call('HGET', sums, '') or '0') > bound then
  -- all sums anew, without what has expired
  local all, sizes, total = redis.call('HGETALL', sums), {}, 0
  for i = 1, #all, 2 do
    local robot = all[i]
    if robot ~= '' then
      if is(set_of(robot), 'zset') then
        sizes[robot] = take(robot, list_old(robot))
        total = total + sizes[robot]
      else
        redis.call('HDEL', sums, robot)
      end
    end
  end
  redis.call('HSET', sums, '', text(total))
  local aim = bound
  if total > bound then aim = bound - bound / {spare} end
  while total > aim and left() > 0 do
    local most
    for robot, size in pairs(sizes) do
      if not most or size > sizes[most] then most = robot end
    end
    local line = most and redis.call('ZRANGE', set_of(most), 0, 0)[1]
    if line then
      local before = sizes[most]
      sizes[most] = take(most, {line})
      total = total - (before - sizes[most])
    elseif most then
      sizes[most] = nil
      redis.call('HDEL', sums, most)
    else
      break
    end
  end
  redis.call('HSET', sums, '', text(total))
  if total > bound then return gone end
end
gone[1] = 1
return gone
"""

# KEYS: the ledger's sums. ARGV: a robot, then lines to remove.
FORGET = """
local sums, robot = KEYS[1], ARGV[1]
local set = sums .. ':' .. robot
if not is(set, 'zset') then return {} end
for i = 2, #ARGV do
  local size = tonumber(string.match(ARGV[i], '%d+$') or '0')
  if redis.call('ZREM', set, ARGV[i]) == 1 and redis.call('HEXISTS', sums, robot) == 1 then
    redis.call('HINCRBY', sums, robot, text(-size))
    redis.call('HINCRBY', sums, '', text(-size))
  end
end
return redis.call('ZRANGE', set, 0, {forgotten} - 1)
"""

# KEYS: stream, segment and, if it has one, schema. ARGV: record, bytes, expiry in ms, the schema's text or
# nothing. FULL: the server is near its `maxmemory`.
WRITE = """
local expiry = tonumber(ARGV[3])
if is(KEYS[2], 'hash') then return {written} end
local info = redis.pcall('INFO', 'memory')
if type(info) == 'string' then
  local most = tonumber(string.match(info, 'maxmemory:(%d+)') or '0')
  local used = tonumber(string.match(info, 'used_memory:(%d+)') or '0')
  if most > 0 and used > {share} * most then return {full} end
end
is(KEYS[1], 'stream')
if KEYS[3] then
  if not is(KEYS[3], 'hash') or redis.call('HEXISTS', KEYS[3], 'text') == 0 then
    if ARGV[4] == '' then return {lacks_schema} end
    redis.call('HSET', KEYS[3], 'text', ARGV[4], 'named', 0)
  end
  redis.call('HINCRBY', KEYS[3], 'named', 1)
  redis.call('PEXPIRE', KEYS[3], expiry)
end
local id = redis.call('XADD', KEYS[1], 'MINID', '=', text(now_ms() - expiry), '*', 'record', ARGV[1])
redis.call('HSET', KEYS[2], 'data', ARGV[2], 'id', id)
redis.call('PEXPIRE', KEYS[1], expiry)
redis.call('PEXPIRE', KEYS[2], expiry)
return {written}
"""

# KEYS: stream, segment and, if it has one, schema.
DELETE = """
if is(KEYS[2], 'hash') then
  local id = redis.call('HGET', KEYS[2], 'id')
  if id and is(KEYS[1], 'stream') then redis.pcall('XDEL', KEYS[1], id) end
  if KEYS[3] and is(KEYS[3], 'hash') and redis.call('HINCRBY', KEYS[3], 'named', -1) <= 0 then
    redis.call('UNLINK', KEYS[3])
  end
  redis.call('UNLINK', KEYS[2])
end
return 1
"""

# KEYS: stream. ARGV: the id to start after (`-`: from the beginning); the most records to return. Returns the
# number of records, the oldest id, then alternating ids and records. It writes nothing.
LOOK = """
local found = {0, ''}
if redis.call('TYPE', KEYS[1]).ok ~= 'stream' then return found end
found[1] = redis.call('XLEN', KEYS[1])
local first = redis.call('XRANGE', KEYS[1], '-', '+', 'COUNT', 1)[1]
if not first then return found end
found[2] = first[1]
local size, after = 0, ARGV[1]
if after ~= '-' then after = '(' .. after end
for _, entry in ipairs(redis.call('XRANGE', KEYS[1], after, '+', 'COUNT', ARGV[2])) do
  local record = entry[2][2]
  size = size + #record
  if size > {look} and #found > 2 then break end
  found[#found + 1] = entry[1]
  found[#found + 1] = record
end
return found
"""


def _script(body: str) -> str:
    numbers = {
        "written": WRITTEN,
        "lacks_schema": LACKS_SCHEMA,
        "full": FULL,
        "share": MEMORY_SHARE,
        "gone": GONE_MAX,
        "forgotten": FORGOTTEN_MAX,
        "spare": SPARE,
        "spare_ms": EXPIRY_SPARE_MS,
        "look": LOOK_BYTES,
    }
    for name, number in numbers.items():
        body = body.replace(f"{{{name}}}", f"{number}")
    return body


ENTER, WRITE, DELETE, FORGET = (_script(_READ + body) for body in (ENTER, WRITE, DELETE, FORGET))
LOOK = _script(LOOK)
