/** `?as=anyone`: this page shows what anyone may see, whoever opens it, and so holds no token. */
export function asAnyone(): boolean {
  return /[?&]as=anyone(&|$)/.test(globalThis.location?.search ?? '');
}
