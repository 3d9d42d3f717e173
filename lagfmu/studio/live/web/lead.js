/* lead.js -- the one curve that stands beside the picture, of a variable that the reader chooses. */

class Lead {
  constructor(figure, seek) {
    this.menu = byId("lead-name");
    this.value = byId("lead-value");
    this.holder = figure.querySelector(".plot");
    this.seek = seek;
    for (const listed of chartList()) {
      const options = listed.places.map((k) => element("option", { value: k }, COLUMNS[k].name));
      this.menu.append(element("optgroup", { label: titled(listed) }, ...options));
    }
    figure.hidden = !this.menu.options.length;
    this.menu.addEventListener("change", () => this.build());
    new ResizeObserver(() => this.chart && this.chart.resize()).observe(this.holder);
    onColors(() => this.trajectory && this.build());
  }

  build() {
    if (this.chart) this.chart.drop();
    const place = Number(this.menu.value);
    this.chart = new Chart(this.holder, [place], COLUMNS[place].name, false, this.seek);
    this.chart.build(this.trajectory);
    this.now(this.t || 0);
  }

  /* From the next run on. */
  choose(name) {
    this.menu.value = PLACE.get(name);
    if (this.chart) this.chart.drop();
    this.chart = null;
  }

  show(trajectory) {
    this.trajectory = trajectory;
    if (!this.menu.options.length) return;
    if (this.chart) this.chart.fill(trajectory);
    else this.build();
  }

  now(t) {
    this.t = t;
    if (!this.chart) return;
    const variable = COLUMNS[this.chart.places[0]];
    const value = this.trajectory.at(variable.name, this.trajectory.place(t));
    this.value.textContent = worded(variable, value, 4);
    this.chart.now(t);
  }
}
