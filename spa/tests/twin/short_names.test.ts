import fc from 'fast-check';
import { describe, expect, it } from 'vitest';
import { shortenNames } from '../../src/twin/short_names.ts';

const letters = (names: readonly string[], room: number) => shortenNames(names, room, () => 1);
const legs = ['left', 'right'].flatMap((side) =>
  ['hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll'].map(
    (part) => `${side}_${part}_joint`,
  ),
);

/** The full name behind a cut one. */
const patternOf = (text: string) => {
  const parts = text.split('…').map((part) => part.replace(/[.*+?^${}()|[\]\\/]/g, '\\$&'));
  return new RegExp(`^${parts.join('.+')}$`, 'su');
};

describe('names that are too long for their room', () => {
  it('stay whole where they fit', () => {
    expect(letters(legs, 23)).toEqual(legs);
    expect(letters(['a', 'bc'], 2)).toEqual(['a', 'bc']);
  });

  it('are cut in the middle, and lose first what all of them share', () => {
    expect(letters(['left_hip_front_pitch', 'left_hip_front_roll', 'left_arm_front_pitch'], 14)).toEqual([
      'left_hip…pitch',
      'left_hip_…roll',
      'left_arm…pitch',
    ]);
    expect(letters(legs, 16).slice(0, 6)).toEqual([
      'left_hip_pitch_…',
      'left_hip_roll_…',
      'left_hip_yaw_…',
      'left_knee_joint',
      'left_ankle_pitc…',
      'left_ankle_roll…',
    ]);
  });

  it('keep the number of each of three hundred joints behind a long prefix', () => {
    const snake = Array.from(
      { length: 300 },
      (_, i) => `a_prefix_of_forty_letters_before_every_joint_${i + 1}`,
    );
    const shown = letters(snake, 12);
    expect(new Set(shown).size).toBe(300);
    for (const [i, text] of shown.entries()) {
      expect(text).toMatch(new RegExp(`….*_${i + 1}$`));
      expect(text.length).toBeLessThanOrEqual(12);
    }
  });

  it('are measured by their letters, not by their count', () => {
    const widthOf = (letter: string) => (letter === 'W' ? 3 : 1);
    expect(shortenNames(['WW_mm_a', 'WW_mm_b'], 10, widthOf)).toEqual(['WW_…_a', 'WW_…_b']);
  });

  it('stay wider than their room rather than look like another', () => {
    expect(letters(['xxxxxLyyyyy', 'xxxxxRyyyyy', 'z'], 3)).toEqual(['…Lyyyyy', '…Ryyyyy', 'z']);
  });

  it('that contain the mark are not taken for others', () => {
    const odd = ['left…pitch', 'left_hip_pitch', 'left_hip_roll', '…', '……'];
    for (let room = 0; room < 12; room += 1) expect(new Set(letters(odd, room)).size).toBe(odd.length);
  });

  it('are never cut within a letter of two code units', () => {
    expect(() => letters(['🦿🦿🦿🦿1', '🦿🦿🦿🦿2'], 3).map(encodeURIComponent)).not.toThrow();
  });
});

describe('whatever the names and the room', () => {
  const word = fc.constantFrom(
    'left',
    'right',
    'hip',
    'knee',
    'arm',
    'joint',
    'a',
    'b',
    '1',
    '2',
    '12',
    'é',
    '관절',
  );
  const name = fc.oneof(
    fc.array(word, { minLength: 1, maxLength: 6 }).map((words) => words.join('_')),
    fc.string({ minLength: 1, maxLength: 12 }),
  );
  const names = fc.uniqueArray(name, { minLength: 1, maxLength: 40 });

  it('each joint can be told apart, and what is shown of one stands in its name', () => {
    fc.assert(
      fc.property(names, fc.integer({ min: 0, max: 30 }), (robot, room) => {
        const whole = letters(robot, 1e9);
        fc.pre(new Set(whole).size === whole.length); // two with the same escaped form never could
        const shown = letters(robot, room);
        expect(new Set(shown).size).toBe(robot.length);
        for (const [i, text] of shown.entries()) {
          if ([...whole[i]!].length <= room) expect(text).toBe(whole[i]);
          else if (text !== whole[i]) expect(whole[i]).toMatch(patternOf(text));
        }
      }),
      { numRuns: 300 },
    );
  });
});
