import { flagWords } from '../../twin/format.ts';

/** A flag's word, which opens its explanation when pressed. `source`: the joint or sensor that reports it. */
export function FlagTerm({ source, bit }: { source: string; bit: string }) {
  return (
    <button
      type="button"
      className="term"
      data-explain="flag"
      data-source={source}
      data-bit={bit}
      aria-haspopup="dialog"
    >
      {flagWords(bit)}
    </button>
  );
}
