/** The real components on free ports: Redis, relay, edges, a tap. Nothing here is simulated. */

import { execFile, execFileSync } from 'node:child_process';
import { closeSync, existsSync, mkdtempSync, openSync, rmSync } from 'node:fs';
import net from 'node:net';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { CLOUD } from './cloud.ts';
import { freePort } from './driver/free_port.ts';
import { until } from './driver/until.ts';
import { Process, type ProcessOptions } from './process.ts';

const execFileAsync = promisify(execFile);

export const REPO = fileURLToPath(new URL('../..', import.meta.url));
export const SHARED = process.env.POSECAST_SHARED ?? path.join(REPO, '..', 'shared');
export const PYTHON = path.join(REPO, '.venv/bin/python');
const BARE_EDGE: readonly string[] = [
  PYTHON,
  '-c',
  'import sys; sys.modules["meshoptimizer"] = None; from posecast_edge.cli.main import main; main()',
];
const DIST = path.join(REPO, 'spa/dist');

export interface RelayOptions {
  readonly role?: 'all' | 'ingest' | 'gateway';
  readonly store?: string;
  readonly httpPort?: number;
  readonly zenohPort?: number;
  /** A file with the access rules for viewers. */
  readonly robots?: string;
  /** A database to which it writes public data. */
  readonly mirror?: string;
  /** The accounts that are signed in: a project, and the host of its Auth emulator. */
  readonly accounts?: { readonly project: string; readonly emulator: string };
  /** Origins of other sites that may embed non-public robots. */
  readonly origins?: string;
  /** A robot's share: frames a second in a view. */
  readonly viewFrames?: number;
  /** Where it keeps the past; '0': no past. */
  readonly past?: string;
  /** Its maximum number of viewers. */
  readonly maxViewers?: number;
  /** A relay that breaks a promise (`tests/faults/broken_relay.py`). */
  readonly breaks?: string;
}

export interface EdgeOptions {
  readonly robot?: string;
  readonly source?: string;
  readonly hz?: number;
  readonly keyInterval?: number;
  readonly profile?: string;
  readonly urdf?: string;
  readonly model?: string;
  /** false: as if the extra `model` were not installed, so that a URDF's meshes are sent unchanged. */
  readonly meshTools?: boolean;
}

/** One sample as `source.py` repeats it. */
export interface Sample {
  readonly [field: string]: unknown;
}

export class Relay {
  readonly url: string;
  readonly zenoh: string;
  readonly #running: () => Process;

  constructor(url: string, zenoh: string, running: () => Process) {
    this.url = url;
    this.zenoh = zenoh;
    this.#running = running;
  }

  get process(): Process {
    return this.#running();
  }

  get host(): string {
    return new URL(this.url).host;
  }

  /** The address of plain HTTP. */
  get port(): number {
    this.#running();
    return Number(new URL(this.url).port);
  }

  async json(route: string): Promise<unknown> {
    const answer = await fetch(this.url + route);
    if (!answer.ok) throw new Error(`${route}: HTTP ${answer.status}`);
    return answer.json();
  }
}

/** A frame as `tap.py` decoded it from Zenoh, before any relay had it. */
export interface TappedFrame {
  readonly seq: number;
  readonly t_s: number;
  /** field → label → value in the field's unit, null = no reading. */
  readonly values: Readonly<Record<string, Readonly<Record<string, number | null>>>>;
  /** URDF joint → rad or m, after the schema's mapping. */
  readonly joints: Readonly<Record<string, number | null>>;
}

export class Tap {
  readonly process: Process;
  readonly #frames = new Map<number, TappedFrame>();

  constructor(start: (onLine: (line: string) => void) => Process) {
    this.process = start((line) => {
      const frame = JSON.parse(line) as TappedFrame;
      this.#frames.set(frame.seq, frame);
    });
  }

  frame(seq: number): TappedFrame | undefined {
    return this.#frames.get(seq);
  }

  get newest(): TappedFrame | undefined {
    return [...this.#frames.values()].at(-1);
  }
}

/** Everything that one test started; `down` ends it, newest first. */
export class Stack {
  readonly #started: Process[] = [];
  readonly #folders: string[] = [];
  readonly #unfit: (why: string) => never;
  #inCloud = false;

  /** `unfit`: the test needs more than a cloud exposes. */
  constructor(
    unfit = (why: string): never => {
      throw new Error(why);
    },
  ) {
    this.#unfit = unfit;
  }

  start(name: string, command: string, args: readonly string[], options: ProcessOptions = {}): Process {
    const running = new Process(name, command, args, options);
    this.#started.push(running);
    return running;
  }

  folder(): string {
    const made = mkdtempSync(path.join(tmpdir(), 'posecast-e2e-'));
    this.#folders.push(made);
    return made;
  }

  /** A separate Redis, in memory only; returns its URL. */
  async redis(): Promise<string> {
    const port = await freePort();
    await this.redisOn(port);
    return `redis://127.0.0.1:${port}/0`;
  }

  /** The same on a fixed port. */
  async redisOn(port: number): Promise<Process> {
    const running = this.start('redis', 'redis-server', [
      ...['--port', String(port), '--bind', '127.0.0.1', '--save', '', '--appendonly', 'no'],
      ...['--dir', this.folder()],
    ]);
    await until('redis listens', () => connects(port));
    return running;
  }

  async relay(options: RelayOptions = {}): Promise<Relay> {
    if (CLOUD !== null) {
      if (Object.keys(options).length > 0) this.#unfit('needs a relay with settings of its own');
      if (this.#inCloud) this.#unfit('needs two relays');
      this.#inCloud = true;
      await CLOUD.forget();
      return new Relay(CLOUD.url, CLOUD.robotsAt, () => this.#unfit('needs a relay of its own'));
    }
    if (!existsSync(path.join(DIST, 'index.html'))) throw new Error('spa/dist is missing: run make setup');
    const flags = [
      ...['run', '--dev', '--port', String(options.httpPort ?? 0)],
      ...['--zenoh-listen', `tcp/127.0.0.1:${options.zenohPort ?? 0}`],
      ...['--static', DIST],
      ...['--role', options.role ?? 'all'],
      ...(options.store === undefined ? [] : ['--store', options.store]),
      ...(options.robots === undefined ? [] : ['--robots', options.robots]),
      ...(options.mirror === undefined ? [] : ['--firebase-database', options.mirror]),
      ...(options.accounts === undefined ? [] : ['--firebase-project', options.accounts.project]),
      ...(options.origins === undefined ? [] : ['--origins', options.origins]),
      ...(options.past === undefined ? [] : ['--past', options.past]),
      ...(options.viewFrames === undefined ? [] : ['--max-view-frames', String(options.viewFrames)]),
      ...(options.maxViewers === undefined ? [] : ['--max-viewers', String(options.maxViewers)]),
    ];
    const { accounts } = options;
    const env = accounts === undefined ? {} : { FIREBASE_AUTH_EMULATOR_HOST: accounts.emulator };
    const broken = [path.join(REPO, 'tests/faults/broken_relay.py'), options.breaks ?? '', ...flags];
    const running =
      options.breaks === undefined
        ? this.start('relay', path.join(REPO, '.venv/bin/posecast-relay'), flags, { env })
        : this.start('relay', PYTHON, broken, { env });
    const found = await running.line(
      /serving http:\/\/127\.0\.0\.1:(\d+), robots (?:on (tcp\/\S+)|from Redis)/,
    );
    return new Relay(`http://127.0.0.1:${found[1]}`, found[2] ?? '', () => running);
  }

  /** A relay with the demo robot on air. */
  async demo(options?: RelayOptions): Promise<Relay> {
    const relay = await this.relay(options);
    this.edge(relay);
    return relay;
  }

  edge(relay: Relay, options: EdgeOptions = {}, stdin: ProcessOptions['stdin'] = 'ignore'): Process {
    const [command = '', ...first] =
      options.meshTools === false ? BARE_EDGE : [path.join(REPO, '.venv/bin/posecast-edge')];
    return this.start(
      'edge',
      command,
      [
        ...first,
        ...['run', '--robot', options.robot ?? 'demo', '--source', options.source ?? 'demo'],
        ...['--relay', relay.zenoh],
        ...this.#credential(options.robot ?? 'demo'),
        ...(options.hz === undefined ? [] : ['--hz', String(options.hz)]),
        ...(options.keyInterval === undefined ? [] : ['--key-interval', String(options.keyInterval)]),
        ...(options.profile === undefined ? [] : ['--profile', options.profile]),
        ...(options.urdf === undefined ? [] : ['--urdf', options.urdf]),
        ...(options.model === undefined ? [] : ['--model', options.model]),
      ],
      { stdin, env: { XDG_CACHE_HOME: this.folder() } },
    );
  }

  /** An edge fed over a pipe by `source.py`, which can be stopped separately. */
  fedEdge(relay: Relay, sample: Sample, options: EdgeOptions = {}): { source: Process; edge: Process } {
    const { read, write } = this.#pipe();
    const source = this.start('source', PYTHON, [path.join(REPO, 'spa/e2e/source.py')], {
      stdin: 'pipe',
      stdout: write,
    });
    source.write(JSON.stringify(sample));
    const edge = this.edge(relay, { source: 'jsonl', ...options }, read);
    closeSync(read); // ours; the edge has a copy
    closeSync(write);
    return { source, edge };
  }

  /** An edge that holds one pose and offers a built model. */
  builtEdge(relay: Relay, files: { folder: string }, sample: Sample, robot: string): Process {
    return this.fedEdge(relay, sample, { robot, model: files.folder }).edge;
  }

  /** Listens beside the relay and decodes what the edge publishes. */
  tap(relay: Relay, robot = 'demo'): Tap {
    if (CLOUD !== null) this.#unfit('nobody listens in on the robots of a cloud');
    const args = [path.join(REPO, 'spa/e2e/tap.py'), relay.zenoh, robot];
    return new Tap((onLine) => this.start('tap', PYTHON, args, { onLine }));
  }

  /** Every process's newest lines. */
  get logs(): string {
    return this.#started.map((running) => `--- ${running.name}\n${running.log}`).join('\n');
  }

  async down(): Promise<void> {
    for (const running of this.#started.toReversed()) await running.stop(); // kept for `logs`: failures are reported afterwards
    for (const made of this.#folders.splice(0)) rmSync(made, { recursive: true, force: true });
  }

  #credential(robot: string): string[] {
    return CLOUD === null ? [] : ['--credential', path.join(CLOUD.credentials, robot)];
  }

  /** Both ends of a named pipe; Node reads its own pipes before anyone else can. */
  #pipe(): { read: number; write: number } {
    const name = path.join(this.folder(), 'pipe');
    execFileSync('mkfifo', [name]);
    const both = openSync(name, 'r+'); // so that neither end waits for the other
    const ends = { read: openSync(name, 'r'), write: openSync(name, 'w') };
    closeSync(both);
    return ends;
  }
}

/** Link → 4×4 row-major matrix, from `fk.py`. Proxies in this process continue meanwhile. */
export async function forwardKinematics(
  urdf: string,
  joints: Configuration,
  base: unknown = null,
): Promise<Record<string, number[]>> {
  const [pose] = await manyForwardKinematics(urdf, [joints], base);
  return pose ?? {};
}

/** rad or m by joint; null and joints not named stand at 0. */
export type Configuration = Readonly<Record<string, number | null>>;

/** The same for several configurations of one robot, which is read once. */
export async function manyForwardKinematics(
  urdf: string,
  joints: readonly Configuration[],
  base: unknown = null,
): Promise<Record<string, number[]>[]> {
  const running = execFileAsync(PYTHON, [path.join(REPO, 'spa/e2e/fk.py')], { maxBuffer: 1 << 26 });
  running.child.stdin?.end(JSON.stringify({ urdf, joints, base }));
  return JSON.parse((await running).stdout) as Record<string, number[]>[];
}

function connects(port: number): Promise<boolean> {
  return new Promise((resolve) => {
    const socket = net.connect({ port, host: '127.0.0.1' });
    socket.once('connect', () => resolve(socket.destroy() !== null));
    socket.once('error', () => resolve(false));
  });
}
