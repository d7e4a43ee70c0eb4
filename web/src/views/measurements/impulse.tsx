/// One measurement: its impulse response over time, and where its features stand among LOS and NLOS.
import { useEffect, useRef, useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import { impulse, type Impulse, type Sample, type Source } from '../../api/measurements';
import { fixed, grouped } from '../../ui/format';
import { Chip, Icon, Q } from '../../ui/marks';
import { feature_words } from '../models/words';
import { percentile } from './choice';
import { marks_of, ordered, unit_of } from './response';
import { KEPT_MAX, ResponsePlot, type Kept } from './response_plot';
import { useStable } from '../../ui/use_stable';

export function ImpulsePanel({
  source,
  sample,
  opened,
  all,
  close,
  step,
}: {
  source: Source;
  sample: Sample;
  opened: number;
  all: readonly Sample[];
  close: () => void;
  step: (by: number) => void;
}) {
  const [loaded, set_loaded] = useState<{ id: number; response: Impulse | null } | null>(null),
    [problem, set_problem] = useState(''),
    [kept, set_kept] = useState<readonly Kept[]>([]);
  const ask = useStable((id: number) => impulse(source, id)),
    { id, has_cir } = sample;
  useEffect(() => {
    let gone = false;
    set_problem('');
    if (has_cir)
      ask(id).then(
        (response) => {
          if (!gone) set_loaded({ id, response });
        },
        (e: unknown) => {
          if (!gone) set_problem(error_text(e));
        },
      );
    return () => {
      gone = true;
    };
  }, [source.id, id, has_cir, ask]);
  const box = useRef<HTMLElement>(null);
  useEffect(() => set_kept([]), [source.id]);
  // Chosen far down in the list, it would open out of sight.
  useEffect(() => box.current?.scrollIntoView({ block: 'start' }), [opened]);
  const response = loaded?.id === sample.id ? loaded.response : null,
    others = kept.filter((k) => k.sample.id !== sample.id),
    is_kept = others.length < kept.length;
  return (
    <section class="cell-p wide impulse" ref={box} data-testid="impulse" aria-label="Selected measurement">
      <div class="hd">
        <h2>
          {sample.who}, {fixed(sample.distance_m, 3)} m
        </h2>
        {sample.los !== null && (
          <Chip
            shape={sample.los ? 'ok' : 'caution'}
            tone={sample.los ? 'ok' : 'caution'}
            word={sample.los ? 'LOS' : 'NLOS'}
          />
        )}
        {sample.truth_m !== null && (
          <span class="meta">
            true {fixed(sample.truth_m, 3)} m, bias {fixed((sample.distance_m - sample.truth_m) * 1000, 0)} mm
          </span>
        )}
        {response && (
          <button
            class="btn small"
            data-testid="keep"
            aria-pressed={is_kept}
            disabled={!is_kept && kept.length >= KEPT_MAX}
            title={`Up to ${KEPT_MAX} stay under the next ones`}
            onClick={() =>
              set_kept(
                is_kept
                  ? others
                  : [...kept, { name: `${sample.who}, ${fixed(sample.distance_m, 2)} m`, sample, response }],
              )
            }
          >
            {is_kept ? 'Kept for comparison' : 'Keep for comparison'}
          </button>
        )}
        {kept.length > 0 && (
          <button class="btn small" onClick={() => set_kept([])}>
            Clear {kept.length}
          </button>
        )}
        <button class="btn small" onClick={() => step(-1)} title="K">
          Previous
        </button>
        <button class="btn small" onClick={() => step(1)} title="J">
          Next
        </button>
        <button class="btn quiet" aria-label="Close the measurement" onClick={close}>
          <Icon name="close" />
        </button>
      </div>
      <div class={sample.has_cir ? 'impulsebox' : ''}>
        {response ? (
          <ResponsePlot response={response} sample={sample} kept={others} />
        ) : (
          <p class={`why${sample.has_cir ? ' cirwait' : ''}`} role="status">
            {problem ||
              (sample.has_cir
                ? 'Loading the impulse response.'
                : 'No impulse response was stored with this measurement.')}
          </p>
        )}
        <Features sample={sample} all={all} response={response} />
      </div>
    </section>
  );
}

const Key = ({ cls }: { cls: string }) => (
  <svg class="key" viewBox="0 0 24 8" aria-hidden="true">
    <path class={cls} d="M0 4H24" />
  </svg>
);
const KEYS: Record<string, string> = { mean_excess_delay_ns: 's mean', rms_delay_spread_ns: 's spread' };

function Features({ sample, all, response }: { sample: Sample; all: readonly Sample[]; response: Impulse | null }) {
  const names = ordered(Object.keys(sample.features)),
    marks = response && marks_of(response, sample.features);
  const rank = (name: string, los: boolean): string => {
    const kind = all.filter((s) => s.los === los && s.features[name] !== undefined).map((s) => s.features[name]!);
    return fixed(percentile(kind, sample.features[name]!), 0);
  };
  if (!names.length && !marks) return <p class="why">The radio reported no diagnostics with it.</p>;
  const plain = (cls: string, name: string, value: string) => (
    <tr>
      <th scope="row">
        <Key cls={cls} />
        {name}
      </th>
      <td class="num">{value}</td>
      <td class="num mut">–</td>
      <td class="num mut">–</td>
    </tr>
  );
  return (
    <table class="tbl reads" data-testid="features">
      <caption>
        % of the LOS and NLOS measurements {all.length ? `(of ${grouped(all.length)} looked at) ` : ''}that lie below
      </caption>
      <thead>
        <tr>
          <th scope="col">Feature</th>
          <th scope="col" class="num">
            Value
          </th>
          <th scope="col" class="num">
            of LOS
          </th>
          <th scope="col" class="num">
            of NLOS
          </th>
        </tr>
      </thead>
      <tbody>
        {marks && plain('s first', 'First path, tap', fixed(marks.first, 1))}
        {marks && plain('s noise', 'Noise floor, rms', marks.noise === null ? '–' : fixed(marks.noise, 1))}
        {names.map((n) => (
          <tr key={n} data-testid={`feature-${n}`}>
            <th scope="row">
              {KEYS[n] && response && <Key cls={KEYS[n]} />}
              {feature_words(n)}
            </th>
            <td class="num">
              <Q v={fixed(sample.features[n], 2)} u={unit_of(n)} />
            </td>
            <td class="num">{rank(n, true)}</td>
            <td class="num">{rank(n, false)}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}
