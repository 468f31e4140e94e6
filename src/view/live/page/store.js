"use strict";
// The course of the test as the page keeps it: bounded arrays of bins, each channel with its smallest and largest value.

/* exported Store */

/** Bins: when, whether the test ran, smallest and largest of each channel, corners of each loop. */
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
    this.loops = Array.from({ length: loops }, () => []);
  }

  /** One bin as the server sends it: when, test time, state, two numbers per channel, a list of points per loop. */
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
    this.loops.forEach((bins, loop) => bins.push(bin[at + loop]));
    if (this.x.length > this.most) this.shrink();
  }

  shrink() {
    if (this.thin) {
      const [low, high] = [(a, b) => (a === null ? b : b === null ? a : Math.min(a, b)), (a, b) => (a === null ? b : b === null ? a : Math.max(a, b))];
      this.x = pairs(this.x, (_, b) => b);
      this.runs = pairs(this.runs, (a, b) => a && b);
      this.low = this.low.map((values) => pairs(values, low));
      this.high = this.high.map((values) => pairs(values, high));
      this.loops = this.loops.map((bins) => pairs(bins, (a, b) => corners([...a, ...b])));
      return;
    }
    // A tenth at a time: taking away one by one would move all the others each time.
    const gone = Math.ceil(this.most / 10);
    for (const values of [this.x, this.runs, ...this.low, ...this.high, ...this.loops]) values.splice(0, gone);
  }

  /** x, then smallest and largest of these channels: what a strip chart draws. */
  columns(channels) {
    return [this.x, ...channels.flatMap((channel) => [this.low[channel], this.high[channel]])];
  }

  /** The bins of a loop from `from` on. */
  loop(index, from) {
    if (!(from > 0)) return this.loops[index];
    let [low, high] = [0, this.x.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.x[middle] < from) low = middle + 1;
      else high = middle;
    }
    return this.loops[index].slice(low);
  }
}

/** Two neighbours become one; a last one without a neighbour stays. */
function pairs(values, join) {
  const joined = [];
  for (let at = 0; at < values.length; at += 2) joined.push(at + 1 < values.length ? join(values[at], values[at + 1]) : values[at]);
  return joined;
}

/** The points that keep the shape of a piece of a loop, as in history.rs; displacement and force alternate in `points`. */
function corners(points) {
  const count = points.length / 2;
  if (count < 2) return points;
  const ends = (value) => {
    let [low, high] = [0, 0];
    for (let at = 1; at < count; at += 1) {
      if (value(at) < value(low)) low = at;
      if (value(at) > value(high)) high = at;
    }
    return [low, high];
  };
  const [disp, force] = [(at) => points[2 * at], (at) => points[2 * at + 1]];
  const [left, right] = ends(disp);
  const [bottom, top] = ends(force);
  const beside = (at) => (disp(right) - disp(left)) * (force(at) - force(left)) - (force(right) - force(left)) * (disp(at) - disp(left));
  const flat = 1e-3 * (disp(right) - disp(left)) * (force(top) - force(bottom));
  const kept = new Set([left, right, bottom, top, ...ends(beside).filter((at) => Math.abs(beside(at)) > flat)]);
  return [...kept].sort((a, b) => a - b).flatMap((at) => [disp(at), force(at)]);
}
