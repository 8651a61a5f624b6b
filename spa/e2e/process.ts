/** A child process whose output is kept, which receives signals by pid, and which does not outlive the test. */

import { type ChildProcess, spawn } from 'node:child_process';
import { Hopeless, until } from './driver/until.ts';

const KEPT_LINES = 400;
const GRACE_MS = 5_000;

const alive = new Set<Process>();
// an interrupted runner stops its children
process.on('exit', () => {
  for (const child of alive) child.signal('SIGKILL');
});

export interface ProcessOptions {
  readonly env?: Readonly<Record<string, string>>;
  /** 'pipe' to use `write`, or an open file descriptor. */
  readonly stdin?: 'pipe' | 'ignore' | number;
  /** An open file descriptor to write to; by default, lines are kept. */
  readonly stdout?: number;
  /** Receives every line of stdout; these lines are data and not kept. */
  readonly onLine?: (line: string) => void;
  /** It starts other processes: they form a group that receives every signal, and the kernel stops it if this runner dies. */
  readonly group?: boolean;
}

export class Process {
  readonly name: string;
  readonly child: ChildProcess;
  readonly #lines: string[] = [];
  readonly #ended: Promise<number | null>;
  readonly #group: boolean;

  constructor(name: string, command: string, args: readonly string[], options: ProcessOptions = {}) {
    this.name = name;
    this.#group = options.group === true;
    const [program, rest] = this.#group
      ? ['setpriv', ['--pdeathsig', 'KILL', '--', command, ...args]]
      : [command, args];
    this.child = spawn(program, rest, {
      detached: this.#group,
      stdio: [options.stdin ?? 'ignore', options.stdout ?? 'pipe', 'pipe'],
      env: { ...process.env, PYTHONUNBUFFERED: '1', ...options.env },
    });
    alive.add(this);
    eachLine(this.child.stdout, options.onLine ?? ((line) => this.#keep(line)));
    eachLine(this.child.stderr, (line) => this.#keep(line));
    this.#ended = new Promise((resolve) => {
      this.child.once('exit', (code) => {
        alive.delete(this);
        resolve(code);
      });
      this.child.once('error', (error) => {
        alive.delete(this);
        this.#lines.push(`${this.name}: ${error.message}`);
        resolve(null);
      });
    });
  }

  /** The newest lines of both outputs, for reporting a failure. */
  get log(): string {
    return this.#lines.join('\n');
  }

  get running(): boolean {
    return alive.has(this);
  }

  /** Waits for a line of either output that matches. */
  line(pattern: RegExp, deadlineMs = 100_000): Promise<RegExpMatchArray> {
    return until(
      `${this.name} prints ${pattern}`,
      () => {
        for (const line of this.#lines) {
          const found = line.match(pattern);
          if (found !== null) return found;
        }
        if (!this.running) throw new Hopeless(`${this.name} has ended:\n${this.log}`);
        return null;
      },
      deadlineMs,
    );
  }

  signal(signal: NodeJS.Signals): void {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    if (this.#group && this.child.pid !== undefined) process.kill(-this.child.pid, signal);
    else this.child.kill(signal);
  }

  write(line: string): void {
    this.child.stdin?.write(`${line}\n`);
  }

  /** Sends SIGKILL and waits for the end. */
  async kill(): Promise<void> {
    this.signal('SIGKILL');
    await this.#ended;
    this.#endRest();
  }

  /** Sends SIGTERM; after 5 s, SIGKILL. */
  async stop(): Promise<number | null> {
    this.signal('SIGCONT'); // a stopped process handles no other signal
    this.signal('SIGTERM');
    const hard = setTimeout(() => this.signal('SIGKILL'), GRACE_MS);
    const code = await this.#ended;
    clearTimeout(hard);
    this.#endRest();
    return code;
  }

  /** Processes left behind by a group's first process. */
  #endRest(): void {
    if (!this.#group || this.child.pid === undefined) return;
    try {
      process.kill(-this.child.pid, 'SIGKILL');
    } catch {
      // none are left
    }
  }

  #keep(line: string): void {
    this.#lines.push(line);
    if (this.#lines.length > KEPT_LINES) this.#lines.shift();
  }
}

function eachLine(stream: NodeJS.ReadableStream | null, take: (line: string) => void): void {
  let rest = '';
  stream?.setEncoding('utf8');
  stream?.on('data', (text: string) => {
    const lines = (rest + text).split('\n');
    rest = lines.pop() ?? '';
    for (const line of lines) take(line);
  });
}
