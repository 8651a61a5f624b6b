import type { pastEn } from './past_en.ts';

/** The Korean sentences of `past_en.ts`. */
export const pastKo: typeof pastEn = {
  timeLine: '타임라인',
  moment: '보이는 순간',
  live: '실시간',
  now: (what) => `지금: ${what}`,
  toLive: '실시간으로 돌아가기 (타임라인에서 End)',
  date: (month, day, year) => (year === null ? `${month} ${day}일` : `${year}년 ${month} ${day}일`),
  seconds: (count) => `${count} s`,
  days: (count) => `${count}일`,
  ago: (span) => `${span} 전`,
  playingAt: (speed) => `${speed} 속도로 재생 중`,
  paused: '일시 정지됨',
  notRecorded: '기록 없음',
  andMore: (what, more) => `${what} 외 ${more}건`,
  within: (what) => `${what}, 이 1분 안에`,

  play: '재생 (스페이스)',
  pause: '일시 정지 (스페이스)',
  previousFault: '이전 고장 (B)',
  nextFault: '다음 고장 (N)',
  tenBack: '10 초 뒤로 (J)',
  tenOn: '10 초 앞으로 (L)',
  frameBack: '한 프레임 뒤로 (,)',
  frameOn: '한 프레임 앞으로 (.)',
  speed: '재생 속도',
  loopFrom: '여기부터 반복 (O)',
  loopTo: '여기까지 반복 (O)',
  loopOff: '반복 끝내기 (O)',
  showLast: (span) => `최근 ${span} 보기`,

  explainLine: '타임라인에 보이는 것',

  notes: {
    loading: '불러오는 중',
    resumed: '그 순간은 이제 보관되어 있지 않아, 남아 있는 가장 오래된 순간부터 이어집니다.',
    'not-kept': '그 순간은 보관되어 있지 않아, 가장 가까운 순간을 보여 줍니다.',
    damaged: '한 부분이 기록된 그대로 오지 않아 건너뛰었습니다.',
    away: '릴레이가 응답하지 않아, 이 페이지가 가진 것만 보여 줄 수 있습니다.',
  },
};
