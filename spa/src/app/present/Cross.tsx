/** A cross that ends or closes something while presenting. `what`: its label. */
export function Cross({ what, onPress }: { what: string; onPress: () => void }) {
  return (
    <button type="button" className="present-cross" title={what} aria-label={what} onClick={onPress}>
      ×
    </button>
  );
}
