import { visible } from '@posecast/wire';

/** A letter with its marks and joiners, or an emoji of several pictures: what no cut may part. */
const LETTER = /.(?:\p{M}|\p{EMod}|\u200c|\u200d.?)*/gsu;
/** A joiner that has lost what it joined. */
const DANGLING = /[\u200c\u200d]+$/;
/** The mark for omitted letters. */
const GAP = '…';
/** Value of any letter, in addition to its word's value: other things being equal, more letters are shown. */
const LETTER_WORTH = 0.02;
/** The cost of a cut inside a word. */
const BROKEN_WORD = 0.3;
/** Worse than any cut: the name does not fit this way. */
const NO_CUT = -100;

/** A way to shorten a name: its first `head` and last `tail` letters. */
interface Cut {
  readonly head: number;
  readonly tail: number;
  readonly worth: number;
}

/** A name as an array of letters, with prefix sums over them. */
interface Spelled {
  readonly text: string;
  readonly letters: readonly string[];
  /** widths[k]: the width of the first k letters. */
  readonly widths: Float64Array;
  /** worths[k]: how much the first k letters tell this name from the others. */
  readonly worths: Float64Array;
  /** breaks[k]: 1 where a word begins or ends before letter k, also at both ends. */
  readonly breaks: Uint8Array;
}

/**
 * Shortens names that are wider than `room` in the middle: "left_hip…pitch". Different names stay different; among the cuts that
 * ensure this, the one that keeps the rarest words is chosen. A name that cannot be distinguished within `room` stays wider.
 * `widthOf` returns the width of one letter. The results are `visible`, but do not stand `alone` yet.
 */
export function shortenNames(
  labels: readonly string[],
  room: number,
  widthOf: (letter: string) => number,
): string[] {
  const names = labels.map(visible);
  const spelled = spell(names, widthOf);
  if (spelled.every(({ widths }) => widths.at(-1)! <= room)) return names;
  const gap = widthOf(GAP);
  const all = cutsOf(spelled, room, gap);
  let shown = spelled.map((name, i) => written(name, all[i]!));
  const [start, end] = sharedEnds(spelled);
  if (start + end > 0) {
    // Letters common to all names carry no information: dropping them leaves room for more of the middle.
    const inner = spelled.map((name) => within(name, start, end));
    const marks = Number(start > 0) + Number(end > 0);
    const cuts = cutsOf(inner, room - marks * gap, gap);
    if (worthOf(cuts) > worthOf(all)) {
      const mark = (text: string) =>
        `${start > 0 ? GAP : ''}${text}${end > 0 ? GAP : ''}`.replaceAll(GAP + GAP, GAP);
      shown = inner.map((name, i) => mark(written(name, cuts[i]!)));
    }
  }
  shown = shown.map((text, i) => (spelled[i]!.widths.at(-1)! <= room ? names[i]! : text));
  return withoutTwins(names, shown);
}

function worthOf(cuts: readonly Cut[]): number {
  return cuts.reduce((sum, { worth }) => sum + worth, 0);
}

function written({ text, letters }: Spelled, { head, tail }: Cut): string {
  if (head + tail >= letters.length) return text;
  return (
    letters.slice(0, head).join('').replace(DANGLING, '') +
    GAP +
    letters.slice(letters.length - tail).join('')
  );
}

/** A name may itself contain the mark. If that makes two names look the same, both are shown in full. */
function withoutTwins(names: readonly string[], shown: readonly string[]): string[] {
  if (new Set(shown).size === shown.length) return [...shown];
  const counts = new Map<string, number>();
  for (const text of [...shown, ...names]) counts.set(text, (counts.get(text) ?? 0) + 1);
  return shown.map((text, i) => (counts.get(text)! > 1 ? names[i]! : text));
}

function spell(names: readonly string[], widthOf: (letter: string) => number): Spelled[] {
  const lettersOf = names.map((name) => name.match(LETTER) ?? []);
  const breaksOf = lettersOf.map(breaksIn);
  const wordsOf = lettersOf.map((letters, i) => wordsIn(letters, breaksOf[i]!));
  const counts = new Map<string, number>();
  for (const words of wordsOf)
    for (const word of new Set(words)) counts.set(word, (counts.get(word) ?? 0) + 1);
  return names.map((text, i) => {
    const letters = lettersOf[i]!;
    const widths = new Float64Array(letters.length + 1);
    const worths = new Float64Array(letters.length + 1);
    let k = 0;
    for (const word of wordsOf[i]!) {
      const size = (word.match(LETTER) ?? []).length;
      const telling = Math.log(names.length / counts.get(word)!) / size;
      for (const end = k + size; k < end; k += 1) {
        widths[k + 1] = widths[k]! + widthOf(letters[k]!);
        worths[k + 1] = worths[k]! + telling + LETTER_WORTH;
      }
    }
    return { text, letters, widths, worths, breaks: breaksOf[i]! };
  });
}

const KINDS = [/\p{Ll}/u, /\p{Lu}/u, /\p{L}/u, /\p{N}/u] as const;

/** A word ends where the kind of letter changes, except for a capital before small letters: "leftHip_2" → left Hip _ 2. */
function breaksIn(letters: readonly string[]): Uint8Array {
  const kinds = letters.map((letter) => KINDS.findIndex((kind) => kind.test(letter)));
  return Uint8Array.from({ length: letters.length + 1 }, (_, k) =>
    Number(
      k === 0 ||
        k === letters.length ||
        (kinds[k] !== kinds[k - 1] && !(kinds[k - 1] === 1 && kinds[k] === 0)),
    ),
  );
}

function wordsIn(letters: readonly string[], breaks: Uint8Array): string[] {
  const words: string[] = [];
  for (let from = 0, k = 1; k <= letters.length; k += 1) {
    if (breaks[k] === 0) continue;
    words.push(letters.slice(from, k).join(''));
    from = k;
  }
  return words;
}

/** The length of the common prefix and suffix of all names, in whole words. */
function sharedEnds(names: readonly Spelled[]): [start: number, end: number] {
  const first = names[0]!;
  let start = first.letters.length;
  let end = start;
  for (const { letters } of names) {
    start = Math.min(start, sharedStart(first.letters, letters));
    end = Math.min(end, sharedEnd(first.letters, letters));
  }
  const ends = (name: Spelled, at: number) => name.breaks[at] === 1;
  while (start > 0 && !names.every((name) => ends(name, start))) start -= 1;
  while (end > 0 && !names.every((name) => ends(name, name.letters.length - end))) end -= 1;
  const shortest = Math.min(...names.map(({ letters }) => letters.length));
  return start + end < shortest ? [start, end] : [0, 0];
}

function within(name: Spelled, start: number, end: number): Spelled {
  const until = name.letters.length - end;
  const from = (sums: Float64Array) => sums.slice(start, until + 1).map((sum) => sum - sums[start]!);
  const letters = name.letters.slice(start, until);
  return {
    text: letters.join(''),
    letters,
    widths: from(name.widths),
    worths: from(name.worths),
    breaks: name.breaks.slice(start, until + 1),
  };
}

function sharedStart(a: readonly string[], b: readonly string[]): number {
  const most = Math.min(a.length, b.length);
  let k = 0;
  while (k < most && a[k] === b[k]) k += 1;
  return k;
}

function sharedEnd(a: readonly string[], b: readonly string[]): number {
  const most = Math.min(a.length, b.length);
  let k = 0;
  while (k < most && a[a.length - 1 - k] === b[b.length - 1 - k]) k += 1;
  return k;
}

/** The best cut of each name, or all of it if it fits. If no cut fits, the narrowest one that is unique. */
function cutsOf(names: readonly Spelled[], room: number, gap: number): Cut[] {
  const bests: Cut[] = names.map(({ letters, widths, worths }) => ({
    head: letters.length,
    tail: 0,
    worth: widths.at(-1)! <= room ? worths.at(-1)! : NO_CUT - widths.at(-1)!,
  }));
  const backwards = names
    .map(({ letters }, i) => ({ i, key: letters.toReversed().join('') }))
    .sort((a, b) => (a.key < b.key ? -1 : 1))
    .map(({ i }) => i);
  const most = Math.max(...names.map(({ letters }) => letters.length));
  for (let head = 0; head < most; head += 1) {
    const least = leastTails(names, backwards, head);
    names.forEach((name, i) => {
      if (least[i] === 0 || name.widths.at(-1)! <= room) return;
      const cut = bestWith(name, head, least[i]! - 1, room - gap);
      if (cut.worth > bests[i]!.worth) bests[i] = cut;
    });
  }
  return bests;
}

/**
 * For each name, one more than the number of last letters that it shares, given its first `head` letters, with another name; 0 if
 * there is no such number. If names are sorted backwards, those with the longest common suffix are neighbours.
 */
function leastTails(names: readonly Spelled[], backwards: readonly number[], head: number): Uint16Array {
  const least = new Uint16Array(names.length);
  const before = new Map<string, number>();
  for (const i of backwards) {
    const { letters } = names[i]!;
    if (letters.length <= head) continue;
    const start = letters.slice(0, head).join('');
    const other = before.get(start);
    before.set(start, i);
    least[i] = Math.max(1, least[i]!);
    if (other === undefined) continue;
    const needed = sharedEnd(letters, names[other]!.letters) + 2;
    least[i] = needed;
    least[other] = Math.max(least[other]!, needed);
  }
  // A name that is a prefix of another has no letters of its own: only its ending distinguishes it.
  for (const i of backwards) if (least[i]! - 1 + head >= names[i]!.letters.length) least[i] = 0;
  return least;
}

/** The best cut with this head and at least this tail. */
function bestWith(
  { letters, widths, worths, breaks }: Spelled,
  head: number,
  leastTail: number,
  room: number,
): Cut {
  const size = letters.length;
  const widthWith = (tail: number) => widths[head]! + widths[size]! - widths[size - tail]!;
  let tail = leastTail;
  if (widthWith(tail) > room) return { head, tail, worth: NO_CUT - widthWith(tail) };
  const worthWith = (count: number) =>
    worths[head]! +
    worths[size]! -
    worths[size - count]! -
    BROKEN_WORD * (2 - breaks[head]! - breaks[size - count]!);
  while (head + tail + 1 < size && widthWith(tail + 1) <= room) tail += 1;
  let best: Cut = { head, tail, worth: worthWith(tail) };
  while (tail > leastTail && breaks[size - tail] === 0) tail -= 1;
  if (worthWith(tail) > best.worth) best = { head, tail, worth: worthWith(tail) };
  return best;
}
