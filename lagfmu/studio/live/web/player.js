/* player.js -- the time that is shown: run, pause, scrub, speed. */

class Player {
  constructor(shown) {
    this.shownAt = shown;
    this.t = 0;
    this.end = 1;
    this.playing = false;
    this.pace = 1; // seconds of the run in one of the reader's
    this.repeats = false;
    this.scrub = byId("scrub");
    this.button = byId("play-button");
    this.scrub.addEventListener("input", () => this.seek(this.scrub.valueAsNumber));
    this.button.addEventListener("click", () => this.toggle());
    document.addEventListener("keydown", (event) => {
      const busy = event.target.closest("input, select, button, summary, a, textarea, [tabindex]");
      if (event.key === " " && !busy) {
        event.preventDefault();
        this.toggle();
      }
    });
  }

  get speed() {
    return Number(byId("speed").value);
  }

  setEnd(end, step) {
    this.end = end;
    this.scrub.max = end;
    this.scrub.step = Math.min(step, end / 100) || "any";
    this.seek(Math.min(this.t, end), true);
  }

  seek(t, quietly = false) {
    this.t = Math.min(Math.max(t, 0), this.end);
    if (!quietly && this.playing) this.last = performance.now();
    this.scrub.value = this.t;
    this.scrub.setAttribute("aria-valuetext", `${shown(this.t, 4)} s`);
    byId("clock").textContent = `${this.t.toFixed(3)} s`;
    this.shownAt(this.t);
  }

  toggle() {
    this.playing = !this.playing;
    this.button.textContent = this.playing ? "Pause" : "Run";
    if (!this.playing) return;
    if (this.t >= this.end) this.t = 0;
    this.last = performance.now();
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.playing) return;
    let t = this.t + (Math.max(0, now - this.last) / 1000) * this.speed * this.pace;
    if (this.repeats && t >= this.end) t %= this.end;
    this.last = now;
    this.seek(t, true);
    if (this.t >= this.end) this.toggle();
    else requestAnimationFrame((next) => this.frame(next));
  }
}
