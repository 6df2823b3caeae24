/** How finely to draw while things move: as finely as the machine keeps up with, by what frames took. */

/** Milliseconds that a frame may take: 60 in a second, with some slack for clocks that are coarse. */
const FAST = 1000 / 55;
/** Frames, or milliseconds with at least two frames, after which a level is known. */
const FRAMES = 5;
const LONG = 200;
/** Frames after a change of level that still pay for the one before. */
const SETTLING = 2;
/** A level that is this much slower than the fastest is as good: finer drawing that costs nothing is kept. */
const ALIKE = 1.15;
/** Milliseconds after which a finer level is tried again when something begins to move. */
const FORGIVE = 20_000;

/** Mean without the longest, which may be an accident; displays show whole beats, so that a median would jump. */
function usual(intervals: number[]): number {
  const sum = intervals.reduce((a, b) => a + b);
  return (sum - Math.max(...intervals)) / (intervals.length - 1);
}

/** Level 0 is the finest. */
export class Pace {
  private current = 0;
  /** Milliseconds of a frame by level; none where that is not known. */
  private costs: (number | undefined)[] = [];
  private intervals: number[] = [];
  private unsettled = SETTLING;
  private last: number | null = null;
  private tried = 0;

  constructor(private readonly levels: number) {}

  get level(): number {
    return this.current;
  }

  /** What is known, for those who wonder. */
  get known(): readonly (number | undefined)[] {
    return this.costs;
  }

  /** A frame of a motion begins at `now`, milliseconds. Returns the level to draw it at. */
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

  /** Nothing moves any more. */
  rest(): void {
    this.last = null;
    this.intervals = [];
  }

  /** Something else is drawn from now on, so what frames took is of no use. */
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
