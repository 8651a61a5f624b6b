import type { saveEn } from './save_en.ts';

/** The Korean sentences of `save_en.ts`. */
export const saveKo: typeof saveEn = {
  title: '파일로 저장',
  span: '구간',
  loop: '반복 구간',
  all: '전체',
  fromTo: '직접 지정',
  from: '시작',
  to: '끝',
  format: '형식',
  formats: {
    csv: {
      name: 'CSV',
      what: 'Excel, pandas, MATLAB에서 여는 표입니다. 프레임마다 한 행, 측정값마다 한 열입니다.',
    },
    posecast: {
      name: 'Posecast',
      what: '로봇 모델까지 모두 담습니다. 파일을 Posecast 페이지에 끌어다 놓으면 재생됩니다.',
    },
  },
  mcap: 'ROS 2 메시지를 담은 MCAP이 필요하면 Posecast로 저장한 뒤 다음을 실행하세요:',
  offered: '기록 전체(균형 제외):',
  measured: (frames, bytes) => `프레임 ${frames.toLocaleString('ko')}개, 약 ${bytes}`,
  measuring: '기록을 확인하는 중 …',
  notYet: (moment) => `${moment}까지 저장됩니다. 그 뒤 몇 초는 릴레이가 아직 쓰는 중입니다.`,
  tooLong: '너무 깁니다. 파일 하나에 10분, 기록 64 MB까지 담을 수 있습니다. 구간을 줄이세요.',
  noSpan: '시작과 그보다 뒤인 끝을 정하세요.',
  nothing: '그 구간에는 기록이 없습니다.',
  away: '릴레이가 응답하지 않습니다. 다시 시도하세요.',
  failed: '파일을 저장하지 못했습니다.',
  save: '저장',
  cancel: '취소',
  saving: '저장하는 중',
  saved: (name, bytes) => `저장했습니다: ${name}, ${bytes}.`,
  lostSegments: (count) => `${count}개 부분을 불러올 수 없어 파일에 빠져 있습니다.`,
  lostModel: '로봇 모델 전체 또는 일부를 불러올 수 없어 파일에 빠져 있습니다.',
};
