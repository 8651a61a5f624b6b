import type { AccountText } from './account_en.ts';

/** The Korean sentences for signing in and out. */
export const accountKo: AccountText = {
  signIn: '로그인',
  signOut: '로그아웃',
  account: '계정',
  whySignIn: '이곳의 계정이 있는 사람에게만 공유된 로봇이 있습니다.',
  email: '이메일',
  password: '비밀번호',
  signedInAs: (name) => `${name}(으)로 로그인했습니다.`,
  signInNotGood: '이메일 또는 비밀번호가 틀립니다.',
  signInDisabled: '사용이 중지된 계정입니다.',
  signInTooMany: '시도가 너무 많습니다. 몇 분 뒤 다시 시도하세요.',
  signInNoAnswer: '로그인 서비스가 응답하지 않습니다. 연결을 확인하고 다시 시도하세요.',
};
