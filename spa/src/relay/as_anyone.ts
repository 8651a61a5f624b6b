/** Whether the address has `?as=anyone`; if so, the page uses no token and shows only what anyone may see. */
export function asAnyone(): boolean {
  return /[?&]as=anyone(&|$)/.test(globalThis.location?.search ?? '');
}
