import type { pastEn } from './past_en.ts';

/** The Korean sentences of `past_en.ts`. */
export const pastKo: typeof pastEn = {
  timeLine: '타임라인',
  moment: '보이는 순간',
  live: '실시간',
  now: (what) => `지금: ${what}`,
  toLive: '실시간으로 돌아가기',
  playingAt: (speed) => `${speed} 속도로 재생 중`,
  paused: '일시 정지됨',
  notRecorded: '기록 없음',
  andMore: (what, more) => `${what} 외 ${more}건`,
  faultsWithin: (count) => `이 1분 안에 고장 ${count}건`,

  play: '재생',
  pause: '일시 정지',
  previousFault: '이전 고장',
  nextFault: '다음 고장',
  tenBack: '10 초 뒤로',
  tenOn: '10 초 앞으로',
  frameBack: '한 프레임 뒤로',
  frameOn: '한 프레임 앞으로',
  speed: '재생 속도',
  loopFrom: '여기부터 반복',
  loopTo: '여기까지 반복',
  loopOff: '반복 끝내기',
  save: '파일로 저장…',
  showLast: (span) => `최근 ${span} 보기`,

  jump: '순간으로 이동',
  explainLine: '타임라인에 보이는 것',
};
