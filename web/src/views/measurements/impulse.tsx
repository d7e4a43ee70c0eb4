/// One measurement: its impulse response over time, and where its features stand among LOS and NLOS.
import { useEffect, useState } from 'preact/hooks';
import { said } from '../../api/client';
import { impulse, type Impulse, type Sample, type Source } from '../../api/measurements';
import { fixed } from '../../ui/format';
import { Chip, Icon } from '../../ui/marks';
import { Axes, Drawing, line, scale, ticks } from '../chart';
import { feature_words } from '../models/words';
import { percentile } from './choice';

const BEFORE_NS = 20, AFTER_NS = 120;   ///< about the first path: where the story is

export function ImpulsePanel({ source, sample, all, close, step }: { source: Source; sample: Sample; all: readonly Sample[]; close: () => void; step: (by: number) => void }) {
  const [response, set_response] = useState<Impulse | null>(null), [problem, set_problem] = useState('');
  useEffect(() => {
    let gone = false;
    set_response(null);
    set_problem('');
    if (source.kind === 'mission' && sample.has_cir) impulse(sample.id).then((r) => { if (!gone) set_response(r); }, (e: unknown) => { if (!gone) set_problem(said(e)); });
    return () => { gone = true; };
  }, [source.id, sample.id]);
  return (
    <section class="cell-p wide impulse" data-testid="impulse" aria-label="Selected measurement">
      <div class="hd">
        <h2>{sample.who}, {fixed(sample.distance_m, 3)} m</h2>
        {sample.los !== null && <Chip shape={sample.los ? 'ok' : 'caution'} tone={sample.los ? 'ok' : 'caution'} word={sample.los ? 'LOS' : 'NLOS'} />}
        {sample.truth_m !== null && <span class="meta">true {fixed(sample.truth_m, 3)} m, bias {fixed((sample.distance_m - sample.truth_m) * 1000, 0)} mm</span>}
        <button class="btn small" onClick={() => step(-1)} title="K">Previous</button><button class="btn small" onClick={() => step(1)} title="J">Next</button>
        <button class="btn quiet" aria-label="Close the measurement" onClick={close}><Icon name="close" /></button>
      </div>
      <div class={response ? 'impulsebox' : ''}>
        {response ? <Response response={response} /> : <p class="why">{problem || (sample.has_cir && source.kind === 'mission' ? 'Loading the impulse response.' : 'No impulse response was kept with this measurement.')}</p>}
        <Features sample={sample} all={all} />
      </div>
    </section>
  );
}

function Response({ response }: { response: Impulse }) {
  const { magnitude, tap_ns } = response, peak = magnitude.indexOf(Math.max(...magnitude)), first = response.first_path ?? peak;
  const from = Math.max(0, Math.floor(first - BEFORE_NS / tap_ns)), to = Math.min(magnitude.length, Math.ceil(first + AFTER_NS / tap_ns)), shown = magnitude.slice(from, to);
  const noise = [...magnitude.slice(0, Math.max(8, Math.floor(first) - 8))].sort((a, b) => a - b), floor = noise[Math.floor(noise.length / 2)] ?? 0;
  const ns = (tap: number): number => (tap - first) * tap_ns, top = Math.max(...shown) * 1.05 || 1;
  return (
    <Drawing cls="cir" label={`Impulse response: first path at tap ${fixed(first, 1)}, strongest ${fixed(ns(peak), 1)} ns after it, noise floor ${fixed(floor, 0)}`} draw={(w, h) => {
      const f = { w, h, left: 52, right: 10, top: 18, bottom: 24 }, x = scale([ns(from), ns(to)], [f.left, w - f.right]), y = scale([0, top], [h - f.bottom, f.top]);
      return <>
        <Axes f={f} x={x} y={y} xs={ticks(ns(from), ns(to), 7)} ys={ticks(0, top, 4)} xw={(v) => `${fixed(v, 0)} ns`} yw={(v) => fixed(v, 0)} />
        <path class="s raw" d={`M${f.left} ${y(floor)}H${w - f.right}`} />
        <path class="s main" d={line(shown.map((m, i) => [x(ns(from + i)), y(m)]))} />
        <path class="goal" d={`M${x(0)} ${f.top}V${h - f.bottom}`} /><text class="ticktext" x={x(0) + 5} y={f.top - 4}>first path</text>
        {peak >= from && peak < to && <circle class="dot" cx={x(ns(peak))} cy={y(magnitude[peak]!)} r="5" />}
      </>;
    }} />
  );
}

function Features({ sample, all }: { sample: Sample; all: readonly Sample[] }) {
  const names = Object.keys(sample.features);
  const rank = (name: string, los: boolean): string => {
    const kind = all.filter((s) => s.los === los && s.features[name] !== undefined).map((s) => s.features[name]!);
    return fixed(percentile(kind, sample.features[name]!), 0);
  };
  if (!names.length) return <p class="why">The radio gave no diagnostics with it.</p>;
  return (
    <table class="tbl reads" data-testid="features">
      <caption>% of the loaded LOS and NLOS measurements that lie below</caption>
      <thead><tr><th scope="col">Feature</th><th scope="col" class="num">Value</th><th scope="col" class="num">of LOS</th><th scope="col" class="num">of NLOS</th></tr></thead>
      <tbody>{names.map((n) => <tr key={n}><th scope="row">{feature_words(n)}</th><td class="num">{fixed(sample.features[n], 2)}</td><td class="num">{rank(n, true)}</td><td class="num">{rank(n, false)}</td></tr>)}</tbody>
    </table>
  );
}
