import type { IncomingMessage } from 'node:http';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Gate, type OwnAnswer } from './gate.ts';
import { Host } from './host.ts';
import { hasSkin, is, there } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** What a browser logs after a session has ended: it follows redirects of scripts and pictures. */
const CUT = /WebSocket|Content.Security.Policy|CORS|MIME type|held back by policy/i;

const says = (page: Page, what: RegExp) => async () => what.test(await page.text());

/** A robot behind a proxy that people sign in to. */
describe('behind a proxy that asks for', () => {
  let gate: Gate;
  /** Of another origin. */
  let login: Host;
  let signedIn = true;
  beforeEach(async () => {
    gate = await Gate.open((await stage.demo()).port);
    login = await Host.open(stage.stack.folder());
    login.instead.set('/index.html', '<p>Who are you?</p>');
    login.instead.set('/favicon.ico', '');
    signedIn = true;
  });
  afterEach(async () => {
    await gate.close();
    await login.close();
  });

  async function showsAll(page: Page): Promise<void> {
    await until('LIVE', is(page, 'LIVE'));
    await until('its body', () => hasSkin(page));
    await until('its past', there(page, 'time-line'));
    await page.evaluate(`location.hash = '#/'`);
    await until('the list', there(page, 'robot-demo'));
    await until('its picture', there(page, 'thumbnail'));
    expect(await page.findByTestId('sign-in-needed').count()).toBe(0);
  }

  it('a password, the page shows everything, and over plain HTTP, too', async () => {
    const wanted = `Basic ${Buffer.from('lab:pw').toString('base64')}`;
    let hasSockets = true;
    gate.answer = ({ headers }) => {
      if (headers.authorization !== wanted)
        return { status: 401, headers: { 'www-authenticate': 'Basic realm="lab"' } };
      return headers.upgrade === undefined || hasSockets ? null : { status: 400 };
    };
    const page = await stage.newPage();
    page.forgive(/status of 401/); // the browser's first request has no password
    await page.open(`${gate.url.replace('//', '//lab:pw@')}/#/r/demo`);
    await showsAll(page);
    hasSockets = false;
    const other = await stage.newPage();
    other.forgive(/status of 40\d|WebSocket/);
    await other.open(`${gate.url.replace('//', '//lab:pw@')}/#/r/demo`);
    await until('LIVE over HTTP', says(other, /over HTTP/));
  });

  /** A cookie like that of oauth2-proxy or Cloudflare Access, and a redirect to the sign-in page without one. */
  function byCookie({ headers, url }: IncomingMessage): OwnAnswer | null {
    const cookie = 'session=1; Path=/; HttpOnly; SameSite=Lax';
    if (url === '/signed-in') return { status: 302, headers: { 'set-cookie': cookie, location: '/r/demo' } };
    if (signedIn && headers.cookie?.includes('session=1')) return null;
    return { status: 302, headers: { location: `${login.url}/` } };
  }

  it('a cookie, the page shows everything, says when to sign in again, and goes on after that', async () => {
    gate.answer = byCookie;
    const newPage = async () => {
      const page = await stage.newPage();
      page.allow(new URL(login.url).host);
      page.forgive(CUT);
      return page;
    };
    const page = await newPage();
    await page.open(`${gate.url}/signed-in`);
    await showsAll(page);
    await page.findByTestId('robot-demo').click();
    await until('LIVE', is(page, 'LIVE'));

    signedIn = false;
    gate.cut();
    await until('it says so', there(page, 'sign-in-needed'));
    const note = page.findByTestId('stage-note');
    await until('in place of a count', async () => (await note.text()).startsWith('Sign in again.'));
    expect(await page.text()).not.toMatch(/Trying again/);
    await page.screenshot('sign-in-again.png');
    const other = await newPage(); // signs in elsewhere
    signedIn = true;
    await other.open(`${gate.url}/signed-in`);
    await until('LIVE by itself', is(page, 'LIVE'));
    expect(await page.findByTestId('sign-in-needed').count()).toBe(0);

    signedIn = false; // the stream lives on
    await page.evaluate(`location.hash = '#/'`);
    await until('the list says so, too', there(page, 'sign-in-needed'));
    await until('instead of its robots', says(page, /Sign in again\./));
    await page.screenshot('sign-in-again-list.png');
    await page.findByRole('button', 'Reload').click();
    await until('the sign-in page', says(page, /Who are you/));
  });
});
