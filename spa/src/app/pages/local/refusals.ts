import { isolated } from '../../../twin/names.ts';
import { DropError } from '../../../urdf/local_files.ts';
import { typedPath } from '../../../urdf/other_formats.ts';
import { more } from '../../text/more.ts';

/** Why the files were refused, in one line, safe to show. `cause`: the error from reading them. */
export function refusalWords(cause: unknown): string {
  if (!(cause instanceof DropError)) return isolated(cause instanceof Error ? cause.message : String(cause));
  const text = more();
  const { refusal } = cause;
  switch (refusal.why) {
    case 'dropTooMany':
      return text.dropTooMany(refusal.count);
    case 'dropBomb':
    case 'dropTooLarge':
      return text[refusal.why](isolated(refusal.path));
    case 'dropOtherFormat':
      return text.dropOtherFormat(isolated(refusal.path), refusal.format, typedPath(refusal.path));
    case 'dropUnreadable':
      return text.dropUnreadable(isolated(refusal.path), isolated(refusal.what));
    default:
      return text[refusal.why];
  }
}
