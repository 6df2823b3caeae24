/** Chooses the level of detail during motions: the finest level at which measured frame times are short enough. */

/** Longest acceptable frame, milliseconds: 60 frames per second with tolerance for coarse clocks. */
const FAST = 1000 / 55;
/** Frames, or milliseconds with at least two frames, after which the frame time of a level is known. */
const FRAMES = 5;
const LONG = 200;
/** Frames after a change of level that are not measured: they may still draw the previous level. */
const SETTLING = 2;
/** Levels at most this much slower than the fastest count as equally fast; the finest of them is used. */
const ALIKE = 1.15;
/** Milliseconds after which a finer level is tried again at the start of a motion. */
const FORGIVE = 20_000;

/** Mean without the longest interval, which may be an outlier. A median would jump between multiples of the refresh interval. */
function usual(intervals: number[]): number {
  const sum = intervals.reduce((a, b) => a + b);
  return (sum - Math.max(...intervals)) / (intervals.length - 1);
}

/** Level 0 is the finest. */
export class Pace {
  private current = 0;
  /** Milliseconds per frame by level; undefined if not measured. */
  private costs: (number | undefined)[] = [];
  private intervals: number[] = [];
  private unsettled = SETTLING;
  private last: number | null = null;
  private tried = 0;

  constructor(private readonly levels: number) {}

  get level(): number {
    return this.current;
  }

  /** Measured milliseconds per frame by level. */
  get known(): readonly (number | undefined)[] {
    return this.costs;
  }

  /** Call at the start of each frame of a motion, at time `now`, milliseconds. Returns the level to draw. */
  step(now: number): number {
    const since = this.last === null ? null : now - this.last;
    this.last = now;
    if (since === null) {
      this.begin(now);
    } else if (this.unsettled > 0) {
      this.unsettled--;
    } else {
      this.intervals.push(since);
      const long = this.intervals.length > 1 && this.intervals.reduce((a, b) => a + b) > LONG;
      if (long || this.intervals.length >= FRAMES) this.learn(now);
    }
    return this.current;
  }

  /** Call at the end of a motion. */
  rest(): void {
    this.last = null;
    this.intervals = [];
  }

  /** Call when other content is drawn: measured frame times are no longer valid. */
  forget(): void {
    this.costs = [];
    this.go(0);
  }

  private begin(now: number): void {
    this.unsettled = Math.max(this.unsettled, 1);
    if (this.current === 0 || now - this.tried < FORGIVE) return;
    this.costs[this.current - 1] = undefined;
    this.tried = now;
    this.go(this.current - 1);
  }

  private learn(now: number): void {
    this.costs[this.current] = usual(this.intervals);
    this.intervals = [];
    const slow = this.costs[this.current]! > FAST;
    const next = this.current + 1;
    if (slow && next < this.levels && this.costs[next] === undefined) {
      this.tried = now;
      return this.go(next);
    }
    if (!slow) return;
    const least = Math.min(...this.costs.map((c) => c ?? Infinity));
    this.go(this.costs.findIndex((c) => c !== undefined && c <= Math.max(FAST, ALIKE * least)));
  }

  private go(level: number): void {
    if (level !== this.current) this.unsettled = SETTLING;
    this.current = level;
    this.intervals = [];
  }
}
