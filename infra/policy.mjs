// policy.mjs PAGE: prints the Content-Security-Policy of a built page, plus a ban on framing it, as lines for
// infra/Caddyfile.
import { readFileSync } from 'node:fs';

const page = readFileSync(process.argv[2], 'utf8');
const said = /http-equiv="Content-Security-Policy"\s+content="([^"]+)"/.exec(page)?.[1];
if (said === undefined) throw new Error(`${process.argv[2]} says nothing of what it may load`);
const policy = said.replaceAll('&#39;', "'");
console.log(`header @hashed Content-Security-Policy "${policy}"`);
console.log(`header @page Content-Security-Policy "${policy}; frame-ancestors 'none'"`);
