import { isolated } from '../../twin/names.ts';
import { useMore } from '../text/more.ts';

/** The page for an unknown address, or for an address with a relay that this page may not read. */
export function NothingHere({ hash, refused }: { hash: string; refused: string | null }) {
  const text = useMore();
  if (refused !== null) {
    return (
      <main className="broken" data-testid="relay-refused">
        <h1>{text.notFromThere}</h1>
        <p>{text.relayRefused(isolated(refused))}</p>
        <a className="text-button" href={`${window.location.pathname}${hash}`}>
          {text.ownRelay}
        </a>
      </main>
    );
  }
  return (
    <main className="broken">
      <h1>{text.nothingHere}</h1>
      <p>{text.namesNothing(isolated(hash))}</p>
      <a className="text-button" href="#/">
        {text.backToAll}
      </a>
    </main>
  );
}
