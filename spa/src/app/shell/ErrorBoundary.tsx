import { Component, type ReactNode } from 'react';
import { isolated } from '../../twin/names.ts';
import { say } from '../text/language.ts';

/** Shows an error message with a reload button instead of its children when rendering them throws. */
export class ErrorBoundary extends Component<{ children: ReactNode }, { what: string | null }> {
  override state: { what: string | null } = { what: null };

  static getDerivedStateFromError(error: unknown): { what: string } {
    return { what: isolated(error instanceof Error ? error.message : String(error)) };
  }

  override render(): ReactNode {
    if (this.state.what === null) return this.props.children;
    return (
      <main className="broken" role="alert">
        <h1>{say().stopped}</h1>
        <p>{say().stoppedWhy(this.state.what)}</p>
        <button type="button" className="text-button" onClick={() => window.location.reload()}>
          {say().reload}
        </button>
      </main>
    );
  }
}
