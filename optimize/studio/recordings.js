// Recordings of the row that was built: files or the microphone, what was measured, and its picture.

import { createCurves, rangeOf } from "./curves.js";

const RATE = 48000; // [1/s] to which recordings are decoded
const FILES = /\.(wav|mp3|m4a|aac|mp4|mov|ogg|oga|opus|webm|flac)$/i;
const MS = 1000;

/** True for a file with sound. */
export const isRecording = ({ name, type }) => /^(audio|video)\//.test(type) || FILES.test(name);

// samples of a file, the mean of its channels
async function decode(file) {
  const sound = await new OfflineAudioContext(1, 1, RATE).decodeAudioData(await file.arrayBuffer()).catch(() => {
    throw new RangeError("this browser finds no sound in it: save it as .wav or .mp3");
  });
  const samples = new Float32Array(sound.length);
  for (let c = 0; c < sound.numberOfChannels; c++) sound.getChannelData(c).forEach((v, i) => { samples[i] += v / sound.numberOfChannels; });
  return { samples, rate: RATE };
}

/**
 * Measurements in a fold of the page.
 * @param {function} $ returns an element of the page by its id
 * @param {function} built returns the row that is shown, `{document, layout}`
 * @param {function} measure promise of the measurement of `{document, layout, samples, rate}`
 * @param {function} use what a button does with a measurement
 * @returns {object} `open(files)` measures recordings
 */
export function createRecordings($, built, measure, use) {
  const sound = createCurves($("heard"), "Sound, hits heard and predicted"), rest = createCurves($("misfit"), "Differences of the hits from the model");
  let recorder = null;

  function draw(name, { rises, hop, start, arrivalTimes, predicted, curve, misfit }) {
    const x = [-0.05, curve.at(-1) + 0.1], first = Math.max(Math.floor((start + x[0]) / hop), 0), shown = rises.slice(first, Math.ceil((start + x[1]) / hop));
    const top = shown.reduce((a, b) => Math.max(a, b)), heard = arrivalTimes.slice(1), points = { points: true, loose: true };
    $("heard").hidden = $("misfit").hidden = false;
    sound.draw({ title: "Rise of the loudness; hits heard (blue) and predicted (orange)", x, y: [0, 1.35 * top], axis: "s", series: [
      { ...points, x: heard, y: heard.map(() => 1.08 * top), colour: "result" },
      { ...points, x: predicted.slice(1), y: heard.map(() => 1.22 * top), colour: "leader" },
      { x: shown.map((_, k) => (first + k) * hop - start), y: shown, colour: "ghost" },
    ] });
    rest.draw({ title: `${name}: hits heard less predicted [ms]`, x, y: rangeOf([...misfit, 0].map((v) => MS * v)), axis: "s", series: [
      { ...points, x: heard, y: misfit.slice(1).map((v) => MS * v), colour: "result" },
      { x: predicted, y: curve.map((t, k) => MS * (t - predicted[k])), colour: "leader" },
    ] });
  }

  async function open(files, row = built()) {
    $("measure").open = true;
    for (const file of files) {
      const line = document.createElement("p");
      line.textContent = `${file.name}: measuring …`;
      $("measured").prepend(line);
      line.scrollIntoView({ block: "nearest" });
      try {
        const result = await measure({ ...row, ...(await decode(file)) }), button = Object.assign(document.createElement("button"), { type: "button", textContent: "Use this friction and push" });
        button.addEventListener("click", () => use(result));
        line.replaceChildren(`${file.name}: ${result.verdict} `, button);
        draw(file.name, result);
      } catch (error) {
        Object.assign(line, { className: "error", textContent: `${file.name}: ${error.message}` });
      }
    }
  }

  async function record() {
    if (recorder) { recorder.stop(); return; }
    $("record").disabled = true; // until it is known whether there is a microphone
    let stream = null;
    try {
      stream = await navigator.mediaDevices.getUserMedia({ audio: { echoCancellation: false, noiseSuppression: false, autoGainControl: false } });
      recorder = new MediaRecorder(stream);
      const row = built();
      recorder.ondataavailable = ({ data }) => open([new File([data], "microphone")], row);
      recorder.onstop = () => {
        stream.getTracks().forEach((track) => track.stop());
        recorder = null;
        $("record").textContent = "Record";
      };
      recorder.start();
      $("record").textContent = "Stop and measure";
    } catch (error) {
      recorder = null;
      stream?.getTracks().forEach((track) => track.stop());
      $("measured").prepend(Object.assign(document.createElement("p"), { className: "error", textContent: `no microphone: ${error.message}` }));
    } finally {
      $("record").disabled = false;
    }
  }

  $("recordings").addEventListener("change", async ({ target }) => { await open([...target.files]); target.value = ""; });
  $("record").hidden = !navigator.mediaDevices;
  $("record").addEventListener("click", record);
  return { open };
}
