"""More than one core in one command: `posecast-relay run --workers N` is one relay of N processes.

The **first worker** is the process that you started. It does everything that a relay does, so with N = 1
nothing in this folder is loaded. It starts N - 1 **further workers** with the same command (`supervisor.py`)
and restarts those that exit. All listen on the same port (SO_REUSEPORT), and the kernel gives each
connection to one of them.

    robots ─► first worker ─► viewers        records, stores, answers HTTP; only it uses Zenoh, the
                 │ feed, a Unix socket       archive and the mirror
                 ▼
              further workers ─► viewers     only serve streams

**A further worker serves streams** (WebSocket, SSE) from its own hub and rules. It forwards all other
requests to the first worker (`forwarder.py` → `private_door.py`). So every worker gives the same answers for
the list, models, the past, deletions and `/readyz`. Each cache exists once, and only one process writes to an
archive.

**The feed** (`feed.py` → `fed_source.py`) sends the same messages as Redis would (`redis/messages.py`) to the
same `ReplicaFeed`. The first worker numbers events and chooses runs. The feed does not depend on the store:
if Redis fails, all N workers keep serving. For a slow worker, only the newest state of each stream waits. A
worker that reads nothing for 5 s is disconnected, reconnects, and gets everything again. (With
`--role gateway`, each worker reads Redis itself, as gateways do.)

**A relay's limits** apply to all workers together. Each worker writes its counts to its part of a shared
memory and reads the others' (`shared_counts.py`). Two workers that accept a viewer at the same moment may
exceed a limit by one each.

**Shutdown.** Signals go to the first worker, which tells the others; they ignore signals. If the first worker
dies, they exit at once, because their control socket closes. If one is too busy to notice, the kernel kills
it (PR_SET_PDEATHSIG).

The sockets are in a folder that only the relay's user can open (mode 0700). It is removed at the end.
"""
