'use strict';
// What the Node servers share: payload, rate, and when each frame was sent (relay/benches/stamps.h explains it).

const fs = require('node:fs');

const SLOTS = 65536;

function options() {
  const asked = {};
  for (let i = 2; i + 1 < process.argv.length; i += 2) asked[process.argv[i].slice(2)] = process.argv[i + 1];
  return { hz: Number(asked.hz), bytes: Number(asked.bytes), stamps: asked.stamps };
}

// Calls `send` with a new frame at every tick. One that comes late is made at once, and the schedule starts anew from it.
function feed({ hz, bytes, stamps }, send) {
  const file = fs.openSync(stamps, 'r+');
  const word = Buffer.alloc(8);
  let seq = 0;
  let due = performance.now();
  const tick = () => {
    seq += 1;
    word.writeBigUInt64LE(process.hrtime.bigint());
    fs.writeSync(file, word, 0, 8, (seq % SLOTS) * 8);
    const frame = Buffer.alloc(bytes, 0x5a);
    frame[0] = 0x13; // a KEY's header, so that the viewers find the seq
    frame.writeUInt32LE(0, 1);
    frame.writeUInt32LE(seq, 5);
    frame.writeDoubleLE(performance.now() / 1000, 9);
    send(frame);
    fs.readSync(file, word, 0, 8, SLOTS * 8); // whether all viewers are connected
    due = Math.max(due + (word.readBigUInt64LE() ? 1000 / hz : 1000), performance.now());
    setTimeout(tick, Math.max(0, due - performance.now()));
  };
  tick();
}

module.exports = { feed, options };
