import type { presentEn } from './present_en.ts';

/** The Korean sentences of `present_en.ts`. */
export const presentKo: typeof presentEn = {
  present: '발표하기',
  presentWhat: '프로젝터용: 로봇만 큰 글자로 보여 줍니다. Esc 키로 나갑니다.',
  keyPresent: '발표하기: 프로젝터용',
  leavePresenting: '발표 끝내기 (Esc)',
  ended: '끝남',
  moreFaults: (count) => `그 밖의 고장 ${count}건`,
};
