import { StrictMode } from 'react';
import { createRoot } from 'react-dom/client';
import { App } from './app/App.tsx';
import { installHandle } from './app/handle.ts';
import './app/styles/tokens.css';
import './app/styles/page.css';
import './app/styles/robot.css';
import './app/styles/numbers.css';
import './app/styles/local.css';

installHandle();
const root = document.getElementById('root');
if (root !== null) {
  createRoot(root).render(
    <StrictMode>
      <App />
    </StrictMode>,
  );
}
