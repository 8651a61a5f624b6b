import { parseSchema, type Schema } from '@posecast/wire';
import { LatePart } from '../../browser/late_part.ts';
import { JointChannels } from '../../twin/kinematic_tree.ts';
import { WrenchTable } from '../../twin/sensors/wrenches.ts';
import type { BalanceDrawing, BalanceReadings, ShownBalance } from './balance_drawing.ts';
import { Deviations } from './deviations.ts';
import type { Sign, SignFrame, SignLabel, SignPicture, SignSettings } from './sign.ts';

/** The schema of a robot that reports nothing, because only its files are shown: of all signs, it has only those of its masses. */
export const FILES = parseSchema(
  JSON.stringify({
    ...{ type: 'schema', v: 1, robot: 'files', labels: { joint: ['joint'] } },
    fields: [{ name: 'pos', labels: 'joint' }],
  }),
);

const DRAWING = new LatePart(
  () => import('./balance_drawing.ts'),
  () => false, // only for robots that can stand, and viewers who want it
);

/** Centre of mass, support polygon and margin, and the limits of the selected joint. */
export class Balance implements Sign {
  static readonly key = 'balance';
  static readonly part = DRAWING;
  readonly #schema: Schema;
  /** Whether the robot can have two feet that measure forces. */
  readonly #isBiped: boolean;
  readonly #isAnchored: boolean;
  #channels: JointChannels | null = null;
  #readings: BalanceReadings | null = null;
  #drawing: BalanceDrawing | null = null;

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#isBiped = new WrenchTable(schema).wrenches.length >= 2;
    this.#isAnchored = schema.field('base') !== null && schema.field('baseq') !== null;
  }

  /** The model decides. */
  static can(): boolean {
    return true;
  }

  static shown({ balance }: SignSettings): boolean {
    return balance !== 'off';
  }

  get drawn(): ShownBalance | null {
    return this.#drawing?.shown ?? null;
  }

  read({ limits, joint, tS, lead, settings: { balance, headingLocked, shown } }: SignFrame): void {
    const schema = this.#schema;
    this.#readings = null;
    if (balance === 'off' || (balance === 'auto' && !this.#isBiped)) return;
    if (joint !== null) this.#channels ??= new JointChannels(schema);
    const isCommanded = shown === 'ref' && Deviations.can(schema); // the states that led up to a moment have no commands
    this.#readings = {
      schema,
      choice: balance,
      limits: limits.threshold('balance', 'margin'),
      joints: joint === null ? [] : this.#channels!.jointsOf(joint),
      anchored: !headingLocked && this.#isAnchored,
      lead: lead === null || isCommanded ? null : { states: lead, tS },
    };
  }

  draw(picture: SignPicture): void {
    if (picture.facets === null || this.#readings === null) {
      this.#drawing = null;
      return;
    }
    const part = DRAWING.value();
    if (part === null) void DRAWING.load();
    else {
      this.#drawing ??= new part.BalanceDrawing();
      this.#drawing.draw(picture, picture.facets, this.#readings);
    }
    picture.feet = this.drawn?.feet ?? [];
    picture.supportM = this.drawn?.floorM ?? null;
  }

  labels(): readonly SignLabel[] {
    return this.#drawing?.labels ?? [];
  }
}
