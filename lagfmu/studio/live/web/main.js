/* main.js -- the page: a change of a setting, a run in the worker, and everything shown anew. */

const MOST_EVENTS = 200; // in the list

const settings = new Settings();
let trajectory = null;
let under = false; // a run is under way
let again = false; // and the settings changed since
let stale = false; // what is shown is of an earlier run: the latest was refused
let asked = 0; // when the change was made that is not yet drawn [ms]

const picture = FACTS.picture ? new Picture(byId("picture"), FACTS.picture) : null;
const player = new Player((t) => showTime(t));
const charts = new Charts(byId("charts"), byId("chart-choices"), (t) => player.seek(t));
const lead = new Lead(byId("lead"), (t) => player.seek(t));
const accuracy = new Accuracy(settings, changed);
const dials = buildDials(byId("dials"), settings, changed);
const measureLater = calmly(() => accuracy.measure(), 250);
const tellLater = calmly(tell, 400);
const describeLater = calmly(describe, 300);

function showAll() {
  dials.show();
  accuracy.show();
  byId("stop-time").value = settings.stopTime;
  byId("step-size").value = settings.stepSize;
}

function changed() {
  asked = performance.now();
  accuracy.forget();
  byId("link-text").hidden = true;
  if (under) again = true;
  else run();
}

async function run() {
  under = true;
  again = false;
  const since = asked;
  try {
    const found = new Trajectory(await computation.run(settings.forRun()), settings);
    trajectory = found;
    show();
    refused(found.failed);
  } catch (error) {
    refused(error.message);
    showLog(error.log || []);
  }
  under = false;
  window.lagfmu.latency = performance.now() - since;
  if (again) run();
  else {
    window.lagfmu.runs = (window.lagfmu.runs || 0) + 1;
    if (!RECORDED) measureLater();
    tellLater();
  }
}

/* The FMU's own words; what is shown then is of the last run that went through. */
function refused(message) {
  const box = byId("refused");
  stale = Boolean(message) && (!trajectory || !trajectory.failed);
  box.hidden = !message;
  if (box.textContent !== (message || "")) box.textContent = message || "";
  byId("play").classList.toggle("stale", stale);
  if (stale) tell();
}

function show() {
  charts.show(trajectory);
  lead.show(trajectory);
  if (picture) picture.show(trajectory);
  player.setEnd(trajectory.end, settings.stepSize);
  dials.tell(trajectory);
  showEvents(trajectory.events);
  showLog(trajectory.log);
}

function showEvents(events) {
  const items = events.slice(0, MOST_EVENTS).map((event) => {
    const jump = element("button", { type: "button" }, `${shown(event.time, 10)} s`);
    jump.addEventListener("click", () => player.seek(event.time));
    const after = event.truth ? `, after ${shown(event.since, 10)} s` : "";
    return element("li", {}, jump, ` ${event.text}${after}`);
  });
  const more = events.length - items.length;
  if (more) items.push(element("li", {}, `and ${more} more, all of them in the CSV file`));
  byId("events").replaceChildren(...items);
  byId("events-count").textContent = events.length;
  byId("events-box").hidden = !events.length;
}

function showLog(log) {
  const items = log
    .slice(0, MOST_EVENTS)
    .map((m) => element("li", {}, m.status === "ok" ? m.message : `${m.status}: ${m.message}`));
  if (log.length > MOST_EVENTS) items.push(element("li", {}, `and ${log.length - MOST_EVENTS} more`));
  byId("log").replaceChildren(...items);
  byId("log-box").hidden = !log.length;
}

function showTime(t) {
  if (!trajectory) return;
  charts.now(t);
  lead.now(t);
  if (picture) picture.now(t);
  if (byId("values-box").open) showValues(t);
  describeLater();
}

const cells = COLUMNS.map((v) => element("td", { class: "number" }));
byId("values").append(
  ...COLUMNS.map((v, k) =>
    element(
      "tr",
      {},
      element("th", { scope: "row" }, element("code", {}, v.name)),
      cells[k],
      element("td", {}, v.unit),
      element("td", { class: "description" }, v.description)
    )
  )
);

function showValues(t) {
  const place = trajectory.place(t);
  COLUMNS.forEach((v, k) => {
    const value = trajectory.at(v.name, place);
    if (!trajectory.isKnown(v, place)) cells[k].textContent = "none yet";
    else cells[k].textContent = v.type === "Boolean" ? shown(Boolean(value)) : shown(value, 10);
  });
}

/* For those who hear the page. */
function tell() {
  if (!trajectory || stale) {
    byId("status").textContent = trajectory ? "Shown is the last run that went through." : "";
    return;
  }
  const steps = STEPS === undefined ? "" : `, ${trajectory.columns[STEPS].at(-1)} steps`;
  const took = trajectory.milliseconds !== null ? `, ${shown(trajectory.milliseconds, 2)} ms` : "";
  const events = trajectory.events.slice(0, 3).map((e) => `${e.text} ${e.truth ? "by" : "at"} ${shown(e.time)} s`);
  if (FACTS.modes) return; // their words stand above
  const end = `Run to ${shown(trajectory.end)} s${steps}${took}`;
  byId("status").textContent = [end, ...events].join("; ");
}

function describe() {
  if (!picture || !trajectory) return;
  const place = trajectory.place(player.t);
  const groups = ["Coordinates", "Multipliers λ"];
  const values = COLUMNS.filter((v) => groups.includes(v.group)).slice(0, 8);
  const told = values.map((v) => `${v.name} ${withUnit(trajectory.at(v.name, place), v.unit, 4)}`);
  byId("picture").setAttribute(
    "aria-label",
    `The mechanism at ${shown(player.t, 4)} s: ${told.join(", ")}`
  );
}

function numberField(id, take) {
  byId(id).addEventListener("change", () => {
    const value = byId(id).valueAsNumber;
    if (Number.isFinite(value) && value > 0) {
      take(value);
      changed();
    } else showAll();
  });
}

function save(name, text, type) {
  const url = URL.createObjectURL(new Blob([text], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

function link() {
  const address = new URL(location.href);
  address.hash = settings.asLink();
  const box = byId("link-text");
  box.hidden = false;
  box.value = address.href;
  box.select();
  if (navigator.clipboard) {
    navigator.clipboard.writeText(address.href).catch(() => {}); // it stands in the field, selected
  }
}

function openLink() {
  if (location.hash.length < 2) return [];
  return settings.takeLink(location.hash.slice(1));
}

numberField("stop-time", (value) => (settings.stopTime = value));
numberField("step-size", (value) => (settings.stepSize = value));
byId("csv").addEventListener("click", () => save(`${FACTS.name}.csv`, trajectory.csv(), "text/csv"));
byId("link").addEventListener("click", link);
byId("reset").addEventListener("click", () => {
  settings.clear();
  showAll();
  changed();
});
byId("values-box").addEventListener("toggle", () => showTime(player.t));
function redraw() {
  if (!trajectory) return;
  picture.fit();
  picture.now(player.t);
}

if (picture) new ResizeObserver(redraw).observe(byId("picture"));
if (picture && picture.inSpace) {
  new Orbit(picture, () => (picture.scene ? trajectory && picture.now(player.t) : redraw()));
  openSpace(picture, redraw).then((opened) => (window.lagfmu.view = opened ? "space" : "flat"));
  window.lagfmu.drawn = () => (picture.scene ? picture.scene.drawn() : []);
}

/* For scripts: what the page shows now. */
window.lagfmu.shown = () => ({
  settings: settings.forRun(),
  events: trajectory.events.map(({ time, text }) => ({ time, text })),
  ...byName(trajectory),
});

if (FACTS.modes) new Modes(player, lead, changed);
const missing = openLink();
window.addEventListener("hashchange", () => {
  settings.clear();
  openLink();
  showAll();
  changed();
});
computation.loaded.then(
  ({ methods }) => {
    accuracy.offer(methods);
    showAll();
    changed();
    if (missing.length) {
      byId("link-problem").hidden = false;
      byId("link-problem").textContent = `The link sets what this FMU does not have: ${missing.join(", ")}`;
    }
  },
  (error) => refused(`The computation cannot start in this browser: ${error.message}`)
);
