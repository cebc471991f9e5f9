// Opens a report page in headless Chromium and checks that its viewer works: no errors, layers
// appear, can be switched off, turned by mouse, keys and touch, cut, coloured and compared, or moved
// from frame to frame. Prints one line of JSON.
//
//   npm install --no-save playwright-core
//   node benches/page_check.mjs REPORT.html [SCREENSHOTS] [--chromium /usr/bin/chromium]
import { createRequire } from "node:module";
import { mkdirSync, statSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const { chromium } = createRequire(resolve("package.json"))("playwright-core");
const options = process.argv.slice(2);
const at = options.indexOf("--chromium");
const [, executablePath] = at < 0 ? ["", "/usr/bin/chromium"] : options.splice(at, 2);
const [page, shots] = options;
const flags = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking"];
const browser = await chromium.launch({ executablePath, args: flags });
const tab = await browser.newPage({ viewport: { width: 1100, height: 900 } });
const errors = [];
// Reading pixels for the screenshots stalls, and Chromium says so.
const counts = (m) => ["error", "warning"].includes(m.type()) && !m.text().includes("ReadPixels");
tab.on("console", (m) => counts(m) && errors.push(m.text()));
tab.on("pageerror", (e) => errors.push(String(e)));
tab.on("request", (r) => r.url().startsWith("http") && errors.push(`fetched ${r.url()}`));
await tab.goto(pathToFileURL(page).href);
await tab.waitForSelector(".viewer[data-ready]", { timeout: 60000 });

const canvas = tab.locator(".viewer canvas");
// The pixels, as a picture; frames are drawn on request, so two are waited for.
async function picture(name) {
  await tab.evaluate(() => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r))));
  const path = shots && `${shots}/${name}.png`;
  if (path) await tab.locator(".viewer").screenshot({ path });
  return (await canvas.screenshot()).toString("base64");
}
if (shots) mkdirSync(shots, { recursive: true });

const failures = [];
let before = await picture("start");
async function changes(name, act) {
  await act();
  const now = await picture(name);
  if (now === before) failures.push(`${name} changes no pixel`);
  before = now;
}
const select = (label, text) => tab.getByLabel(label, { exact: true }).selectOption({ label: text });
const boxes = tab.locator(".viewer label:has(i) input");
const count = await boxes.count();
await changes("outermost_off", () => boxes.nth(count - 1).click());
await changes("all_on", () => boxes.nth(count - 1).click());
await changes("dragged", async () => {
  const box = await canvas.boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await tab.mouse.move(x, y);
  await tab.mouse.down();
  await tab.mouse.move(x + 120, y + 40, { steps: 4 });
  await tab.mouse.up();
});
await changes("keys", () => tab.keyboard.press("ArrowLeft"));
await changes("wheel", () => tab.mouse.wheel(0, -300));
await changes("section", () => select("Section", "section: front"));
// Before and after, or frames; a page of meshes alone has neither.
const slider = tab.locator(".viewer input[type=range]:not([aria-label])");
const states = (await slider.count()) && (await slider.getAttribute("max"));
if (states === "1") {
  await changes("before", () => slider.fill("0"));
  await changes("halfway", () => slider.fill("0.5"));
  await slider.fill("1");
  await select("Section", "no section");
  before = await picture("after");
  await changes("displacement", () => select("Colours", "displacement"));
  await changes("strain", () => select("Colours", "strain"));
}
if (Number(states) > 1) {
  await changes("another_frame", () => slider.fill("1"));
}
const cdp = await tab.context().newCDPSession(tab);
await changes("touched", async () => {
  const box = await canvas.boundingBox();
  for (const [type, across] of [["touchStart", 0], ["touchMove", 60], ["touchMove", 120]]) {
    const point = { x: box.x + box.width / 2 + across, y: box.y + box.height / 2 };
    await cdp.send("Input.dispatchTouchEvent", { type, touchPoints: [point] });
  }
  await cdp.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
});
await changes("dark", () => tab.emulateMedia({ colorScheme: "dark" }));

// Frames a second while the camera turns.
const rate = await tab.evaluate(async () => {
  const canvas = document.querySelector(".viewer canvas");
  const begin = performance.now();
  let frames = 0;
  while (performance.now() - begin < 2000) {
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    await new Promise((r) => requestAnimationFrame(r));
    frames += 1;
  }
  return (1000 * frames) / (performance.now() - begin);
});
const ready = Number(await tab.locator(".viewer").getAttribute("data-ready"));
await browser.close();
failures.push(...errors);
const bytes = statSync(page).size;
const result = { page, bytes, first_picture_ms: ready, frames_a_second: Math.round(rate), failures };
console.log(JSON.stringify(result));
process.exit(failures.length ? 1 : 0);
