import { texts } from './language.ts';
import { accountEn, balanceEn, momentsEn, pastEn, recordingEn, saveEn } from './late_en.ts';

/** About a robot's past: the time line. */
export const [pastText, usePastText] = texts(pastEn, ({ pastKo }) => pastKo);
/** About finding a moment of a long past. */
export const [, useMomentsText] = texts(momentsEn, ({ momentsKo }) => momentsKo);
/** About saving a part of the past. */
export const [, useSaveText] = texts(saveEn, ({ saveKo }) => saveKo);
/** About a recording. */
export const [recordingText, useRecordingText] = texts(recordingEn, ({ recordingKo }) => recordingKo);
/** About balance. */
export const [balanceText, useBalanceText] = texts(balanceEn, ({ balanceKo }) => balanceKo);
export type BalanceText = typeof balanceEn;
/** For signing in and out. */
export const [accountText, useAccountText] = texts(accountEn, ({ accountKo }) => accountKo);
