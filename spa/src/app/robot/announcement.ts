import type { Link } from '../../stream/client.ts';
import type { Fault } from '../../twin/alarms/fault_log.ts';
import { displayOf, formatNumber } from '../../twin/format.ts';
import { isClaim, type Verdict } from '../../twin/liveness.ts';
import { isolated } from '../../twin/names.ts';
import { type Imu, leanOf } from '../../twin/sensors/imus.ts';
import type { Arrow, Wrench } from '../../twin/sensors/wrenches.ts';
import { more } from '../text/language.ts';
import { faultWords } from '../words/fault.ts';
import { behindWords, causeWords, warningWords } from '../words/status.ts';

/** The text that screen readers are given about a robot. */
export interface Announcement {
  text: string;
  /** The text in coarser steps: it changes only when the text should be announced again, not when a number varies a
   *  little. */
  gist: string;
}

/** The inputs of an announcement. */
export interface AnnouncementInput {
  name: string;
  verdict: Pick<Verdict, 'word' | 'cause' | 'overShare'>;
  /** Why the connection ended, if it has. */
  ending?: Link['ending'];
  /** The delay of the picture, ms; null: none. */
  behindMs?: Link['behindMs'];
  /** The newest readings of its force-torque sensors, and of the one that measures its lean; null before any. */
  readings: { readonly wrenches: readonly Wrench[]; readonly body: Imu | null } | null;
  faults: readonly Fault[];
  /** A sentence about its balance; null if there is none. */
  balance?: Announcement | null;
}

const DEGREES = 180 / Math.PI;
/** A tilt below this is called upright, without its angle. */
const LEAN_DEG = 1.5;
/** A tilt from here on is called far from upright, or from `LYING_DEG` on lying. */
const FAR_DEG = 30;
const LYING_DEG = 60;
/** A tilt is announced again when it has changed by about this much. */
const LEAN_STEP_DEG = 5;
const MOST_NAMED = 3;
const ZERO_WIDTH = /^\u2007/;

/** One line about a robot: "demo: live; upright, leaning 3° left; right hand 28 N, caution; 2 joints with faults". The
 *  text is empty while the liveness is not known yet. */
export function announcement({
  name,
  verdict,
  ending = null,
  behindMs = null,
  readings,
  faults,
  balance = null,
}: AnnouncementInput): Announcement {
  const { word } = verdict;
  if (word === null) return { text: '', gist: '' };
  const reasons = [causeWords(verdict.cause, { ending }), warningWords(verdict)].filter(
    (part) => part !== '',
  );
  const behind = behindWords(behindMs, word);
  const said = behind === '' ? reasons : [behind, ...reasons];
  const state = more().spokenState(word, said.length === 0 ? null : said.join(', '));
  // The last values of a robot that is not live would sound like current ones.
  const parts = isClaim(word) ? [posture(readings), ...forces(readings), ...faulted(faults)] : [];
  const stands = isClaim(word) ? balance : null;
  const told = parts.filter((part) => part.text !== '');
  const line = [`${name}: ${state}`, ...told.map(({ text }) => text)].join('; ');
  return {
    text: stands === null ? line : `${line}. ${stands.text}`,
    // a delay change of a second is not announced again
    gist: [
      word,
      behind === '' ? '' : 'behind',
      ...reasons,
      ...told.map(({ gist }) => gist),
      stands?.gist ?? '',
    ].join('; '),
  };
}

function posture(readings: AnnouncementInput['readings']): Announcement {
  const lean = readings?.body == null ? null : leanOf(readings.body);
  if (lean === null) return { text: '', gist: '' };
  const { roll, pitch } = lean;
  const tilt = Math.acos(Math.max(-1, Math.min(1, Math.cos(roll) * Math.cos(pitch)))) * DEGREES;
  const stance = tilt >= LYING_DEG ? more().lying : tilt >= FAR_DEG ? more().farOver : more().upright;
  if (tilt < LEAN_DEG) return { text: stance, gist: stance };
  // Roll is about the forward axis; when positive, the right side is lower. Positive pitch leans forward.
  const side = roll > 0 ? more().right : more().left;
  const along = pitch > 0 ? more().forward : more().backward;
  const where = Math.abs(roll) > Math.abs(pitch) ? side : along;
  return {
    text: more().leaning(stance, Math.round(tilt), where),
    gist: `${stance} ${where} ${Math.round(tilt / LEAN_STEP_DEG)}`,
  };
}

function forces(readings: AnnouncementInput['readings']): Announcement[] {
  const worrying = (readings?.wrenches ?? []).filter((wrench) => levelOf(wrench) !== 'ok');
  worrying.sort((a, b) => Number(levelOf(b) === 'fault') - Number(levelOf(a) === 'fault'));
  const named = worrying.slice(0, MOST_NAMED).map((wrench) => {
    const level = levelOf(wrench);
    const ofForce = wrench.force.level === level;
    const arrow: Arrow = ofForce ? wrench.force : wrench.moment;
    const size = arrow.vector === null ? null : Math.hypot(...arrow.vector);
    const shown = { ...displayOf(ofForce ? 'N' : 'Nm', 'rad'), decimals: 0 };
    const value = size === null ? '' : ` ${formatNumber(size, shown).replace(ZERO_WIDTH, '')} ${shown.unit}`;
    const word = level === 'fault' ? more().pastLimit : more().caution;
    return { text: `${wrench.name}${value}, ${word}`, gist: `${wrench.site} ${level}` };
  });
  const further = worrying.length - named.length;
  const rest = further > 0 ? [{ text: more().moreForces(further), gist: `+${further}` }] : [];
  return [...named, ...rest];
}

function levelOf({ force, moment }: Wrench): Arrow['level'] {
  if (force.level === 'fault' || moment.level === 'fault') return 'fault';
  return force.level === 'caution' || moment.level === 'caution' ? 'caution' : 'ok';
}

function faulted(faults: readonly Fault[]): Announcement[] {
  const lasting = (level: Fault['level']) =>
    new Map(
      faults
        .filter((fault) => fault.level === level && fault.clearedMs === null)
        .map((fault) => [fault.source, fault]),
    );
  return [
    ...counted(lasting('fault'), more().jointsFaulted),
    ...counted(lasting('caution'), more().jointsOff),
  ];
}

/** A single fault is named; for several, only their number is given. */
function counted(of: ReadonlyMap<string, Fault>, many: (count: number) => string): Announcement[] {
  const [first] = of.values();
  if (first === undefined) return [];
  const gist = [...of.keys()].join(' ');
  return [{ text: of.size === 1 ? `${isolated(first.source)}: ${faultWords(first)}` : many(of.size), gist }];
}
