import { DropError } from '../drop/files.ts';
import { more } from './more.ts';

/** Why what was dropped is not shown, in one line. */
export function refusalWords(cause: unknown): string {
  if (!(cause instanceof DropError)) return cause instanceof Error ? cause.message : String(cause);
  const text = more();
  const { refusal } = cause;
  switch (refusal.why) {
    case 'dropTooMany':
      return text.dropTooMany(refusal.count);
    case 'dropBomb':
    case 'dropTemplate':
    case 'dropTooLarge':
      return text[refusal.why](refusal.path);
    case 'dropUnreadable':
      return text.dropUnreadable(refusal.path, refusal.what);
    default:
      return text[refusal.why];
  }
}
