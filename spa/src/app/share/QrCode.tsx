import encodeQr from 'qr';
import { useMemo } from 'react';
import { useMore } from '../text/language.ts';

/** A QR code, or a note if the text is too long for one. It is dark on light in either theme, as cameras expect. */
export function QrCode({ text, className }: { text: string; className: string }) {
  const words = useMore();
  const code = useMemo(() => path(text), [text]);
  if (code === null) return <p className="share-remark">{words.linkTooLong}</p>;
  return (
    <svg
      className={className}
      viewBox={`0 0 ${code.size} ${code.size}`}
      role="img"
      aria-label={words.linkAsCode}
    >
      <rect width={code.size} height={code.size} fill="#fff" />
      <path d={code.path} fill="#101828" />
    </svg>
  );
}

function path(text: string): { size: number; path: string } | null {
  try {
    const rows = encodeQr(text, 'raw', { ecc: 'medium', border: 3 });
    const squares = rows.flatMap((row, y) => row.flatMap((dark, x) => (dark ? [`M${x} ${y}h1v1h-1z`] : [])));
    return { size: rows.length, path: squares.join('') };
  } catch {
    return null; // more than a QR code can hold
  }
}
