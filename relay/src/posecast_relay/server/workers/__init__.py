"""More than one core in one command: `posecast-relay run --workers N` is one relay of N processes.

The **first worker** is the process that was started. It does all that a relay does, so with N = 1 nothing of
this folder is loaded. It starts N - 1 **further workers**, the same command anew (`supervisor.py`), and
starts one that ended again. All listen on the one port (SO_REUSEPORT): the kernel gives each connection to
one of them.

    robots ─► first worker ─► viewers        records, keeps, answers HTTP; the only one that knows Zenoh, an
                 │ feed, a Unix socket       archive, a mirror
                 ▼
              further workers ─► viewers     streams, nothing else of their own

**A further worker serves streams itself** (WebSocket, SSE), from a hub and rules of its own. Whatever else
it is asked it passes to the first worker (`forwarder.py` → `private_door.py`). So the list, a model, the
past and its take names, deletions and `/readyz` are the same from each, each cache exists once, and one
process writes an archive.

**The feed** (`feed.py` → `fed_source.py`) says what Redis would say, in the same words
(`redis/messages.py`), to the same `ReplicaFeed`: events are numbered and runs chosen once, by the first
worker. It says so whatever the store is: with Redis dead all N serve on, as one does. Of a stream only the
newest waits for a worker that reads slowly. One that takes nothing for 5 s loses its connection, connects
anew and is told all. (Workers of `--role gateway` read Redis, each by itself, as gateways do.)

**One relay's limits** hold over all workers: each writes what it has into its part of a shared memory and
reads the others' (`shared_counts.py`). Two that take somebody at the same moment may exceed a limit by one
each.

**Ends.** A signal goes to the first worker; the others ignore it and are told. When the first one is gone
they end at once: their control socket closes, and the kernel kills them should they be too busy to notice
(PR_SET_PDEATHSIG).

Sockets are in a folder that only the relay's user may open (mode 0700), removed at the end.
"""
