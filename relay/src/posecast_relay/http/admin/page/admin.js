/** The page for whoever runs the relay. The credential is kept in this module alone: no storage, no cookie, no address. */

const EVERY_MS = 5000;
const SURE_MS = 5000; // a second click within it revokes
const DAY_S = 86400;
const SOON_DAYS = 14; // a certificate that ends within them is marked

const ENGLISH = {
  admin: 'admin',
  lock: 'Lock',
  credential: 'Admin credential',
  open: 'Open',
  made_by: '`posecast-relay robots admin` prints it once. The page forgets it when you lock or close it.',
  robots: 'Robots',
  wrong: 'Wrong credential.',
  away: 'The relay does not answer.',
  state: 'Relay',
  ready: 'ready',
  viewers: 'Viewers',
  skipped: 'Skipped frames',
  refused: 'Refused publishers',
  past: 'Past in memory',
  archive: 'Past in the archive',
  disk: 'Free disk space',
  of: 'of',
  days: 'days',
  online: 'online',
  silent: 'silent',
  offline: 'offline',
  conflict: 'two agents send under this name',
  over_share: 'sends more than its share',
  unsent: 'The robot does not send this view. It sends:',
  publishes: 'Publishes with',
  by_credential: 'credential',
  by_certificate: 'certificate',
  until: 'until',
  anyone: 'Anyone sees',
  'signed-in': 'Signed-in viewers see',
  link: 'Link holders see',
  watched_by: 'Who may watch',
  nobody: 'nobody',
  make: 'Make a share link, 7 days',
  made: 'Anyone with this link can watch.',
  local: 'It only works on this machine. To make links for others, start the relay with --public-url.',
  copy: 'Copy',
  copied: 'Copied',
  revoke: 'Revoke all share links',
  sure: 'Really revoke all?',
  revoked: 'All share links of this robot are revoked.',
  no_link_rule: 'Share links show nothing yet. To change that, run:',
};
const KOREAN = {
  admin: '관리',
  lock: '잠그기',
  credential: '관리자 자격 증명',
  open: '열기',
  made_by: 'posecast-relay robots admin 명령이 한 번만 보여 줍니다. 잠그거나 닫을 때까지 이 페이지에만 남습니다.',
  robots: '로봇',
  wrong: '자격 증명이 틀립니다.',
  away: '릴레이가 응답하지 않습니다.',
  state: '릴레이',
  ready: '정상',
  viewers: '시청자',
  skipped: '건너뛴 프레임',
  refused: '거부된 송신자',
  past: '메모리의 과거 기록',
  archive: '아카이브의 과거 기록',
  disk: '남은 디스크',
  of: '/',
  days: '일',
  online: '온라인',
  silent: '신호 없음',
  offline: '오프라인',
  conflict: '두 에이전트가 같은 이름으로 보냅니다',
  over_share: '허용량보다 많이 보냅니다',
  unsent: '로봇이 이 뷰를 보내지 않습니다. 보내는 뷰:',
  publishes: '송신 방법',
  by_credential: '자격 증명',
  by_certificate: '인증서',
  until: '만료',
  anyone: '누구나 보는 것',
  'signed-in': '로그인하면 보는 것',
  link: '공유 링크로 보는 것',
  watched_by: '볼 수 있는 사람',
  nobody: '없음',
  make: '공유 링크 만들기 (7일)',
  made: '공유 링크입니다. 이 링크가 있으면 누구나 볼 수 있습니다.',
  local: '이 컴퓨터에서만 열립니다. 페이지 주소를 --public-url 로 지정해 릴레이를 시작하세요.',
  copy: '복사',
  copied: '복사됨',
  revoke: '모든 공유 링크 취소',
  sure: '정말 모두 취소할까요?',
  revoked: '이 로봇의 공유 링크를 모두 취소했습니다.',
  no_link_rule: '아직 공유 링크로 보이는 것이 없습니다. 바꾸려면 실행하세요:',
};
const isKorean = navigator.language.toLowerCase().startsWith('ko');
const text = isKorean ? KOREAN : ENGLISH;
document.documentElement.lang = isKorean ? 'ko' : 'en';
for (const each of document.querySelectorAll('[data-text]')) each.textContent = text[each.dataset.text];

const $ = (id) => document.getElementById(id);
let credential = '';
let asked = 0; // an answer to an earlier question is dropped
const cards = new Map(); // by robot: its card, and what that shows
const OWN_HOST = /^(localhost|127\.[\d.]+|\[::1\])$/;

/** Asks the relay. Throws an Error whose message is for people; `status` 401: not the credential. */
async function ask(path, method = 'GET') {
  let answer;
  try {
    answer = await fetch(`../api/v1/admin${path}`, {
      method,
      headers: { authorization: `Bearer ${credential}` },
      cache: 'no-store',
      credentials: 'omit',
    });
  } catch {
    throw new Error(text.away);
  }
  const told = await answer.json().catch(() => ({}));
  if (answer.ok) return told;
  throw Object.assign(new Error(answer.status === 401 ? text.wrong : (told.error ?? text.away)), {
    status: answer.status,
  });
}

function make(tag, content = '', kind = '') {
  const made = document.createElement(tag);
  made.textContent = content;
  made.className = kind;
  return made;
}

function complain(words) {
  $('trouble').textContent = words;
  $('trouble').hidden = words === '';
}

function lock() {
  credential = '';
  asked += 1;
  cards.clear();
  $('robots').replaceChildren();
  $('figures').replaceChildren();
  $('shown').hidden = $('lock').hidden = true;
  $('door').hidden = false;
  $('credential').value = '';
  $('credential').focus();
}

async function look() {
  if (credential === '') return;
  asked += 1;
  const mine = asked;
  try {
    const report = await ask('');
    if (mine !== asked) return;
    complain('');
    $('door').hidden = true;
    $('credential').value = '';
    $('shown').hidden = $('lock').hidden = false;
    showFigures(report);
    showRobots(report.robots);
  } catch (error) {
    if (mine !== asked) return;
    if (error.status !== undefined && error.status < 500) lock();
    complain(error.message);
  }
}

const bytes = (n) => {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let at = 0;
  while (n >= 1000 && at < units.length - 1) {
    n /= 1000;
    at += 1;
  }
  return `${at === 0 || n >= 100 ? Math.round(n) : n.toFixed(1)} ${units[at]}`;
};
const count = (n) => n.toLocaleString(isKorean ? 'ko' : 'en');
const date = (s) => new Date(s * 1000).toISOString().slice(0, 10);

function showFigures({ relay, past, archive, certificates }) {
  const rows = [
    [text.state, relay.trouble ?? text.ready, relay.trouble === null ? 'good' : 'bad'],
    [text.viewers, count(relay.viewers)],
    [text.skipped, count(relay.skipped_frames)],
    [text.refused, count(relay.refused_publishers)],
  ];
  if (past !== null) rows.push([text.past, `${bytes(past.bytes)} ${text.of} ${bytes(past.bytes_max)}`]);
  if (archive !== null) {
    rows.push([text.archive, archive.trouble ?? bytes(archive.stored_bytes), archive.trouble ? 'bad' : '']);
    if (archive.free_bytes !== null)
      rows.push([text.disk, `${bytes(archive.free_bytes)} ${text.of} ${bytes(archive.disk_bytes)}`]);
  }
  for (const [flag, until_s] of Object.entries(certificates)) {
    const left = Math.floor((until_s - Date.now() / 1000) / DAY_S);
    rows.push([flag, `${date(until_s)} (${left} ${text.days})`, left < SOON_DAYS ? 'bad' : '']);
  }
  $('figures').replaceChildren(...rows.map((row) => makeFact(...row)));
}

function makeFact(name, value, kind = '') {
  const row = make('div');
  row.append(make('dt', name), make('dd', value, kind));
  return row;
}

function showRobots(robots) {
  const names = new Set(robots.map((each) => each.robot));
  for (const [name, { card }] of cards)
    if (!names.has(name)) {
      card.remove();
      cards.delete(name);
    }
  // what is in its place already, or says the same, is not touched: it may have the focus, or be marked to be copied
  let next = $('robots').firstElementChild;
  for (const robot of robots) {
    if (!cards.has(robot.robot)) cards.set(robot.robot, { card: makeCard(robot.robot), shows: '' });
    const known = cards.get(robot.robot);
    if (known.card === next) next = next.nextElementSibling;
    else $('robots').insertBefore(known.card, next);
    const told = JSON.stringify(robot);
    if (known.shows !== told) fillCard(known.card, robot);
    known.shows = told;
  }
}

/** A robot's card. Its buttons stay while its words are told anew, so that none moves under a finger. */
function makeCard(name) {
  const card = make('li');
  card.dataset.robot = name;
  const words = make('div');
  words.dataset.part = 'words';
  const said = make('p', '', 'quiet');
  said.setAttribute('role', 'status');
  const address = make('input');
  address.readOnly = true;
  address.hidden = true;
  address.setAttribute('aria-label', text.made);
  const copy = make('button', text.copy);
  copy.hidden = true;
  const link = make('button', text.make);
  const revoke = make('button', text.revoke);
  for (const button of [copy, link, revoke]) button.type = 'button';
  const path = `/robots/${encodeURIComponent(name)}/links`;
  const act = async (call) => {
    try {
      await call();
    } catch (error) {
      said.textContent = error.message;
    }
  };
  link.onclick = () =>
    act(async () => {
      const made = await ask(path, 'POST');
      const leads = new URL(made.link, new URL('../', location.href));
      address.value = leads.href;
      address.hidden = copy.hidden = false;
      copy.textContent = text.copy;
      said.textContent = OWN_HOST.test(leads.hostname) ? `${text.made} ${text.local}` : text.made;
    });
  copy.onclick = () =>
    act(async () => {
      address.select();
      await navigator.clipboard.writeText(address.value);
      copy.textContent = text.copied;
    });
  let timer = 0;
  const calm = () => {
    clearTimeout(timer);
    revoke.classList.remove('sure');
    revoke.textContent = text.revoke;
  };
  revoke.onclick = () => {
    if (!revoke.classList.contains('sure')) {
      revoke.classList.add('sure');
      revoke.textContent = text.sure;
      timer = setTimeout(calm, SURE_MS);
      return;
    }
    calm();
    act(async () => {
      await ask(path, 'DELETE');
      address.hidden = copy.hidden = true;
      said.textContent = text.revoked;
    });
  };
  const line = make('div', '', 'line');
  line.append(link, revoke);
  const shared = make('div', '', 'line');
  shared.append(address, copy);
  card.append(words, line, said, shared);
  return card;
}

function fillCard(card, robot) {
  const head = make('div', '', 'head');
  const kind = { online: 'good', silent: 'bad', offline: 'quiet' }[robot.status];
  head.append(make('h3', robot.robot), make('span', text[robot.status] ?? robot.status, `sign ${kind}`));
  const by = robot.publishes_by === 'certificate' ? text.by_certificate : text.by_credential;
  const until = robot.expires_s === null ? '' : `, ${text.until} ${date(robot.expires_s)}`;
  const audiences = Object.entries(robot.audiences).map(([who, what]) => makeFact(text[who] ?? who, what));
  const facts = make('dl', '', 'facts');
  facts.append(
    makeFact(text.viewers, count(robot.viewers)),
    makeFact(text.publishes, `${by}${until}`),
    ...(audiences.length > 0 ? audiences : [makeFact(text.watched_by, text.nobody)]),
  );
  const lines = [facts];
  if (robot.conflict) lines.push(make('p', text.conflict, 'bad'));
  if (robot.over_share) lines.push(make('p', `${text.over_share}: ${robot.over_share}`, 'bad'));
  for (const [who, view] of Object.entries(robot.unsent_views ?? {}))
    lines.push(make('p', `${text[who] ?? who}: ${view}. ${text.unsent} ${robot.sent_views.join(', ')}`, 'bad'));
  if (!robot.may_link)
    lines.push(
      make('p', text.no_link_rule, 'quiet'),
      make('code', `posecast-relay robots set ${robot.robot} --link view=public`),
    );
  card.querySelector('[data-part=words]').replaceChildren(head, ...lines);
  const [link, revoke] = card.querySelectorAll('.line > button');
  link.hidden = !robot.may_link;
  revoke.hidden = !robot.has_links;
}

$('door').onsubmit = (event) => {
  event.preventDefault();
  credential = $('credential').value.trim();
  look();
};
$('lock').onclick = () => {
  lock();
  complain('');
};
setInterval(() => document.visibilityState === 'visible' && look(), EVERY_MS);
document.onvisibilitychange = () => document.visibilityState === 'visible' && look();
$('credential').focus();
