"""Atomic Lua scripts that keep an older state from replacing a newer one in Redis.

A *generation* is one process's turn at writing a robot. A process claims the next generation for every run
that it adopts, and whenever it takes a robot over. It is higher than every generation in Redis for that
robot, and at least Redis's clock in milliseconds. So it is also higher than those that gateways remember
after Redis has lost its data.

The writer holds a lease (`…:writer`), which every write and every sign of life renews. While it lasts, lower
generations are refused. A higher generation without a lease blocks nobody: the writer that finds it claims a
new one. Keys of a wrong type, invalid numbers, and leases without an expiry are ignored.
"""

from __future__ import annotations

from posecast_relay.redis.client import STATUS_MS, TTL_S

LEASE_MS = 1500  # an active robot is written at least twice a second; the presence of others once a second

STORED, REFUSED, INCOMPLETE, OUTRUN = 1, 0, 2, 3

_READ = """
local function whole(text)
  local n = tonumber(text or '')
  if n and n >= 0 and n < 4503599627370496 and n == math.floor(n) then return n end
  return 0
end
local function read(key)
  local text = redis.pcall('GET', key)
  return type(text) == 'string' and whole(text) or 0
end
local function lease(key)
  local left = redis.call('PTTL', key)
  return left > 0 and left <= {lease_ms} and read(key) or 0
end
local function fields(key, ...)
  local found = redis.pcall('HMGET', key, ...)
  if not found.err then return found end
  redis.call('DEL', key)
  return {}
end
local function text(n) return string.format('%.0f', n) end
"""

# KEYS: counter, writer, and the robot's states. ARGV: '1' when this process hears the robot's frames: else it
# claims no robot that another one writes. Returns the new generation, or REFUSED.
CLAIM = """
if ARGV[1] ~= '1' and lease(KEYS[2]) > 0 then return 0 end
local newest = math.max(read(KEYS[1]), read(KEYS[2]))
for i = 3, #KEYS do newest = math.max(newest, whole(fields(KEYS[i], 'generation')[1])) end
local t = redis.call('TIME')
local generation = math.max(newest + 1, t[1] * 1000 + math.floor(t[2] / 1000))
redis.call('SET', KEYS[1], text(generation), 'EX', {counter_s})
redis.call('SET', KEYS[2], text(generation), 'PX', {lease_ms})
return generation
"""

# KEYS: state, counter, channel, writer. ARGV: generation, seq, '1' when this is the whole state, the KEY's
# id, a message for the channel, then the state's fields and values. A light write (frame only) that finds
# another KEY or nothing there is INCOMPLETE: the whole state is to be written next.
GUARD = """
local state, counter, writer = KEYS[1], KEYS[2], KEYS[4]
local generation, seq, full = tonumber(ARGV[1]), tonumber(ARGV[2]), ARGV[3] == '1'
if lease(writer) > generation then return 0 end
local has = fields(state, 'generation', 'seq', 'key_id')
local has_generation = whole(has[1])
if has_generation > generation or (has_generation == generation and whole(has[2]) > seq) then return 3 end
if not full and (has_generation ~= generation or has[3] ~= ARGV[4]) then return 2 end
redis.call('HSET', state, 'generation', ARGV[1], 'seq', ARGV[2], 'key_id', ARGV[4], unpack(ARGV, 6))
if full then
  redis.call('EXPIRE', state, {state_s})
  redis.call('SET', counter, text(math.max(read(counter), generation)), 'EX', {counter_s})
end
redis.call('SET', writer, ARGV[1], 'PX', {lease_ms})
redis.call('SPUBLISH', KEYS[3], ARGV[5])
return 1
"""

# KEYS: status, channel, writer, counter, and the states that this process has written. ARGV: generation, and
# what is told. INCOMPLETE: some of it has been lost, so the whole state is to be written next.
STATUS = """
local generation = tonumber(ARGV[1])
if lease(KEYS[3]) > generation then return 0 end
redis.call('SET', KEYS[1], ARGV[2], 'PX', {status_ms})
redis.call('SET', KEYS[3], ARGV[1], 'PX', {lease_ms})
redis.call('SPUBLISH', KEYS[2], ARGV[2])
if #KEYS > 4 and read(KEYS[4]) == 0 then return 2 end
for i = 5, #KEYS do
  if redis.call('TYPE', KEYS[i]).ok ~= 'hash' then return 2 end
end
return 1
"""


def _script(body: str) -> str:
    script = _READ + body
    numbers = {"state_s": TTL_S, "counter_s": 2 * TTL_S, "lease_ms": LEASE_MS, "status_ms": STATUS_MS}
    for name, number in numbers.items():
        script = script.replace(f"{{{name}}}", str(number))
    return script


CLAIM, GUARD, STATUS = _script(CLAIM), _script(GUARD), _script(STATUS)
