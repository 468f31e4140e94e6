"use strict";
// The course of the test as the page keeps it: bounded arrays of bins, each channel with its smallest and largest value.

/* exported Store */

/** Bins: when, whether the test ran, smallest and largest of each channel, points of each loop. */
class Store {
  /** At most `most` bins; beyond, `thin` joins neighbours, else the oldest go. */
  constructor(channels, loops, most, thin) {
    this.most = most;
    this.thin = thin;
    this.clear(channels, loops);
  }

  clear(channels, loops) {
    this.x = [];
    this.runs = [];
    this.low = Array.from({ length: channels }, () => []);
    this.high = Array.from({ length: channels }, () => []);
    this.disp = Array.from({ length: loops }, () => []);
    this.force = Array.from({ length: loops }, () => []);
  }

  /** One bin as the server sends it: when, test time, state, two numbers a channel, four a loop. */
  push(bin, running) {
    const when = bin[0];
    if (this.x.length > 0 && !(when > this.x[this.x.length - 1])) return;
    this.x.push(when);
    this.runs.push(running(bin[2]));
    let at = 3;
    for (let channel = 0; channel < this.low.length; channel += 1) {
      this.low[channel].push(bin[at]);
      this.high[channel].push(bin[at + 1]);
      at += 2;
    }
    for (let loop = 0; loop < this.disp.length; loop += 1) {
      this.disp[loop].push(bin[at], bin[at + 2]);
      this.force[loop].push(bin[at + 1], bin[at + 3]);
      at += 4;
    }
    if (this.x.length > this.most) this.shrink();
  }

  shrink() {
    if (this.thin) {
      const [low, high] = [(a, b) => (a === null ? b : b === null ? a : Math.min(a, b)), (a, b) => (a === null ? b : b === null ? a : Math.max(a, b))];
      this.x = pairs(this.x, (_, b) => b);
      this.runs = pairs(this.runs, (a, b) => a && b);
      this.low = this.low.map((values) => pairs(values, low));
      this.high = this.high.map((values) => pairs(values, high));
      const loops = this.disp.map((disps, loop) => ends(disps, this.force[loop]));
      this.disp = loops.map((loop) => loop[0]);
      this.force = loops.map((loop) => loop[1]);
      return;
    }
    // A tenth at a time: taking away one by one would move all the others each time.
    const gone = Math.ceil(this.most / 10);
    for (const values of [this.x, this.runs, ...this.low, ...this.high]) values.splice(0, gone);
    for (const values of [...this.disp, ...this.force]) values.splice(0, 2 * gone);
  }

  /** x, then smallest and largest of these channels: what a strip chart draws. */
  columns(channels) {
    return [this.x, ...channels.flatMap((channel) => [this.low[channel], this.high[channel]])];
  }

  /** The loop from `from` on. */
  loop(index, from) {
    let first = 0;
    if (from > 0) {
      let [low, high] = [0, this.x.length];
      while (low < high) {
        const middle = (low + high) >> 1;
        if (this.x[middle] < from) low = middle + 1;
        else high = middle;
      }
      first = 2 * low;
    }
    if (first === 0) return [this.disp[index], this.force[index]];
    return [this.disp[index].slice(first), this.force[index].slice(first)];
  }
}

/** Two neighbours become one; a last one without a neighbour stays. */
function pairs(values, join) {
  const joined = [];
  for (let at = 0; at < values.length; at += 2) joined.push(at + 1 < values.length ? join(values[at], values[at + 1]) : values[at]);
  return joined;
}

/** Of four points the ones of smallest and largest displacement, in order. */
function ends(disps, forces) {
  const joined = [[], []];
  for (let at = 0; at < disps.length; at += 4) {
    const all = [at, at + 1, at + 2, at + 3].filter((place) => place < disps.length);
    const known = all.filter((place) => disps[place] !== null);
    const by = (better) => known.reduce((best, place) => (better(disps[place], disps[best]) ? place : best), known[0] ?? at);
    const chosen = [by((a, b) => a < b), by((a, b) => a > b)].sort((a, b) => a - b);
    for (const place of chosen) {
      joined[0].push(disps[place]);
      joined[1].push(forces[place]);
    }
  }
  return joined;
}
