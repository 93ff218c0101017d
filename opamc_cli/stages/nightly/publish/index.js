"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const [perUnit, lowest] = data.scale;
  const digits = "0123456789abcdefghijklmnopqrstuvwxyz";
  const rank = data.states.map(([name]) => name); // worst first
  const step = 200;
  const rows = [];
  for (const [robot, joints] of data.robots) {
    for (const [axis, state, since, night, report, spark, program] of joints) {
      const [name, sign, role] = data.states[state];
      rows.push({ robot, axis, name, sign, role, since, night, report, spark, program });
    }
  }
  const byName = (a, b) => a.robot.localeCompare(b.robot, undefined, { numeric: true }) || a.axis - b.axis;
  const last = (row) => { const known = row.spark.replaceAll(".", ""); return known ? digits.indexOf(known.at(-1)) : -1; };
  const orders = {
    worst: (a, b) => rank.indexOf(a.name) - rank.indexOf(b.name) || last(b) - last(a) || byName(a, b),
    robot: byName,
    night: (a, b) => (a.night < b.night ? -1 : a.night > b.night ? 1 : byName(a, b)),
  };
  const at = (id) => document.getElementById(id);
  for (const name of rank) {
    if (rows.some((row) => row.name === name)) {
      at("state").append(new Option(name === "known" ? "acknowledged" : name, name));
    }
  }
  const svg = (name, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  };
  const line = (spark) => {
    const levels = [...spark].map((c) => (c === "." ? null : digits.indexOf(c)));
    const top = Math.max(12, ...levels.filter((level) => level !== null));
    const width = Math.max(levels.length - 1, 1);
    const y = (level) => (28 - (26 * level) / top).toFixed(1);
    let path = "", pen = false;
    levels.forEach((level, index) => {
      if (level === null) { pen = false; return; }
      path += `${pen ? "L" : "M"}${((100 * index) / width).toFixed(1)} ${y(level)}`;
      if (!pen && (index + 1 >= levels.length || levels[index + 1] === null)) path += "h.01";
      pen = true;
    });
    const drawn = svg("svg", { class: "spark", viewBox: "0 0 100 30", preserveAspectRatio: "none", "aria-hidden": "true" });
    const zero = y(-lowest * perUnit);
    drawn.append(svg("line", { x1: 0, x2: 100, y1: zero, y2: zero }), svg("path", { d: path }));
    return drawn;
  };
  const cell = (kind, ...content) => {
    const made = document.createElement("td");
    made.className = kind;
    made.append(...content);
    return made;
  };
  const draw = (row) => {
    const made = document.createElement("tr");
    let night = row.night || "–";
    if (row.report) {
      night = document.createElement("a");
      night.href = row.report.split("/").map(encodeURIComponent).join("/");
      night.textContent = row.night;
    }
    const said = row.name === "known" ? "acknowledged" : row.name;
    made.append(
      cell("robot", row.program ? `${row.robot}, ${row.program}` : row.robot),
      cell(row.axis ? "n" : "none", row.axis ? String(row.axis) : ""),
      cell(`state ${row.role}`, `${row.sign} ${said}`),
      cell(`line ${row.role}`, row.spark ? line(row.spark) : ""),
      cell("since", row.since || ""),
      cell(row.night < data.nights.at(-1) ? "night changed" : "night", night),
    );
    return made;
  };
  let found = [], shown = 0;
  const more = () => {
    at("rows").append(...found.slice(shown, shown + step).map(draw));
    shown = Math.min(shown + step, found.length);
    at("more").hidden = shown >= found.length;
    const joints = rows.some((row) => row.program) ? "joints, each program's by itself" : "joints";
    at("count").textContent = `${shown} of ${found.length} ${joints}`;
  };
  const update = () => {
    const wanted = at("robot").value.trim().toLowerCase(), state = at("state").value;
    found = rows.filter((row) => (!wanted || row.robot.toLowerCase().includes(wanted)) && (!state || row.name === state));
    found.sort(orders[at("sort").value]);
    shown = 0;
    at("rows").replaceChildren();
    more();
  };
  at("more").addEventListener("click", more);
  at("robot").addEventListener("input", update);
  at("state").addEventListener("change", update);
  at("sort").addEventListener("change", update);
  update();
})();
