/* modes.js -- a page of modes: which of the recorded runs is shown, with its words, over and over. */

class Modes {
  constructor(player, lead, changed) {
    const menu = byId("mode");
    menu.append(...FACTS.modes.map(({ title }) => element("option", {}, title)));
    menu.addEventListener("change", () => this.show(menu.selectedIndex));
    Object.assign(this, { player, lead, changed });
    player.repeats = true;
    this.show(0, true);
  }

  show(k, quietly = false) {
    const { words, pace, curve } = FACTS.modes[k];
    byId("mode-words").textContent = words;
    computation.chosen = k;
    this.lead.choose(curve);
    this.player.pace = pace;
    this.player.t = 0;
    if (!quietly) this.changed();
  }
}
