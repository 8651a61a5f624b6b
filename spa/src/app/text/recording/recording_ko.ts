import type { recordingEn } from './recording_en.ts';

/** The Korean sentences of `recording_en.ts`. */
export const recordingKo: typeof recordingEn = {
  noRecording: '이 녹화를 보여 줄 수 없습니다',
  noIndex: '여기에 recording.json이 없습니다.',
  newer: '더 새로운 Posecast가 만든 녹화라 이 페이지에서 읽을 수 없습니다.',
  indexDamaged: (what) => `recording.json이 손상되었습니다: ${what}.`,
  hostAway: '이 녹화가 있는 서버가 응답하지 않습니다. 다시 시도합니다.',
  noneDropped: '이 파일에는 녹화가 없습니다.',
  fileDamaged: (what) => `이 .posecast 파일을 읽을 수 없습니다: ${what}.`,
  wholeFolder: '녹화의 일부일 뿐인 파일입니다. 폴더 전체를 여세요.',

  note: (when) => `녹화: ${when}.`,
  within: (at, length) => `${length} 중 ${at}`,
  lacks: (asked, shown) => `${asked}은(는) 이 녹화에 없어 가장 가까운 ${shown}을(를) 보여 줍니다`,

  gap: ' 녹화의 이 부분이 없습니다.',
  lost: (count, parts) => `${parts}개 부분 중 ${count}개가 없거나 손상되었습니다.`,
  someNewer: '그중 일부는 더 새로운 Posecast가 만들었습니다.',
  noMoment: '링크에 순간이 없어 처음부터 보여 줍니다.',

  about: '이 녹화에 대하여',
  title: '제목',
  author: '만든 이',
  licence: '라이선스',
  robot: '로봇',
  view: '보기',
  recordedAt: '녹화 시각',
  length: '길이',
  data: '데이터',
  notes: '메모',
  openNote: '메모 전체 보기',
  closeNote: '메모 접기 (Esc)',
  close: '녹화 닫기',
};
