import { Fragment } from 'react';
import { bytesWords } from './Outcome.tsx';

/** A file of a whole recording for other programs, which lies beside the page. */
export interface OfferedFile {
  /** As people call it: `CSV`. */
  readonly format: string;
  readonly url: string;
  /** As it is called once it is on the viewer's computer. */
  readonly name: string;
  readonly bytes: number;
}

/** Links to them. */
export function OfferedFiles({ files }: { files: readonly OfferedFile[] }) {
  return files.map(({ format, url, name, bytes }, i) => (
    <Fragment key={format}>
      {i > 0 && ' · '}
      <a href={url} download={name} className="offered-file">
        {format} ({bytesWords(bytes)})
      </a>
    </Fragment>
  ));
}
