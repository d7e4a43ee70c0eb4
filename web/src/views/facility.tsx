/// What the facility manager keeps of an anchor, read and edited where it stands.
import { useEffect, useState } from 'preact/hooks';
import { ApiError, error_text } from '../api/client';
import { change_facility, facility, patch_of, type Facility, type Fields } from '../api/facility';
import { draft_of } from '../state/drafts';
import { may } from '../state/session';
import { say, when_back } from '../state/store';
import { Problem } from '../ui/problem';
import { useDraft } from '../ui/use_draft';
import { useStable } from '../ui/use_stable';

const FIELDS: readonly (readonly [Exclude<keyof Fields, 'external_ids'>, string, string])[] = [
  ['name', 'Name', 'Hall A north-west'],
  ['building', 'Building', 'B1'],
  ['floor', 'Floor', '0'],
  ['space', 'Room', 'A0.12'],
  ['asset_tag', 'Asset tag', 'as on its label'],
  ['ifc_guid', 'IFC GUID', '22 characters, from the BIM model'],
];

/// ISO 16739 IfcGloballyUniqueId: 128 bits as 22 characters of base 64, the first of which carries two bits.
export const IFC_GUID = '[0-3][0-9A-Za-z_$]{21}';
const IFC_WORDS = 'IFC GUID: 22 characters of 0-9, A-Z, a-z, _ and $, the first of 0 to 3';

const key_of = (anchor: string): string => `facility/${anchor}`;
export function FacilityPanel({ anchor, changed }: { anchor: string; changed: () => void }) {
  const [read, set_read] = useState<(Facility & { readonly anchor: string }) | null>(null),
    [problem, set_problem] = useState(''),
    [editing, set_editing] = useState('');
  const load = useStable((): Promise<void> =>
    facility(anchor).then(
      (f) => {
        set_read({ ...f, anchor });
        set_problem('');
      },
      (e: unknown) => {
        if (!(e instanceof ApiError && e.problem.status === 404)) set_problem(error_text(e));
      },
    ),
  );
  useEffect(() => {
    set_problem('');
    set_editing(draft_of(key_of(anchor)) ? anchor : '');
    void load();
  }, [anchor, load]);
  const missing = read?.anchor !== anchor;
  useEffect(() => (missing ? when_back(() => void load()) : undefined), [missing, load]);
  const known = missing ? null : read;
  if (!known && !problem) return null;
  return (
    <section class="sec-p" data-testid="facility">
      <div class="hd">
        <h2>Facility</h2>
        {known && may('integrator') && editing !== anchor && (
          <button class="btn small" data-testid="facility-edit" onClick={() => set_editing(anchor)}>
            Edit
          </button>
        )}
      </div>
      <Problem text={problem} />
      {known && editing !== anchor && <Shown fields={known.fields} />}
      {known && editing === anchor && (
        <Form
          anchor={anchor}
          known={known}
          reload={load}
          failed={set_problem}
          close={() => {
            set_editing('');
            set_problem('');
          }}
          done={(f) => {
            set_read({ ...f, anchor });
            set_editing('');
            set_problem('');
            changed();
            say(`${anchor} changed`);
          }}
        />
      )}
    </section>
  );
}

function Shown({ fields }: { fields: Fields }) {
  const given = FIELDS.filter(([key]) => fields[key]);
  if (!given.length && !fields.external_ids.length)
    return <p class="why">No facility data: no name, room or asset tag.</p>;
  return (
    <dl class="kv s">
      {given.map(([key, words]) => (
        <div key={key}>
          <dt>{words}</dt>
          <dd>{fields[key]}</dd>
        </div>
      ))}
      {fields.external_ids.map((e) => (
        <div key={`${e.system}/${e.id}`}>
          <dt>{e.system}</dt>
          <dd>{e.id}</dd>
        </div>
      ))}
    </dl>
  );
}

interface Editing {
  anchor: string;
  known: Facility;
  done: (f: Facility) => void;
  close: () => void;
  reload: () => Promise<void>;
  failed: (why: string) => void;
}
function Form({ anchor, known, done, close, reload, failed }: Editing) {
  // Only what was typed is kept, not the fields beside it: those may be others' by the time it is sent.
  const [{ typed }, keep, forget] = useDraft<{ typed: Partial<Fields> }>(key_of(anchor), { typed: {} }),
    [busy, set_busy] = useState(false);
  const form: Fields = { ...known.fields, ...typed },
    change = (part: Partial<Fields>): void => keep({ typed: { ...typed, ...part } });
  const patch = patch_of(known.fields, form),
    same = Object.keys(patch).length === 0;
  const ids = form.external_ids,
    set_id = (i: number, part: { system?: string; id?: string }): void =>
      change({ external_ids: ids.map((e, k) => (k === i ? { ...e, ...part } : e)) });
  const save = async (): Promise<void> => {
    set_busy(true);
    failed('');
    try {
      const kept = await change_facility(anchor, known.etag, patch);
      forget();
      done(kept);
    } catch (e) {
      const overtaken = e instanceof ApiError && e.problem.status === 412;
      if (overtaken) await reload();
      failed(
        overtaken
          ? 'Somebody else has changed this anchor; their values are shown, and yours are kept. Check them, then save.'
          : error_text(e),
      );
      set_busy(false);
    }
  };
  return (
    <form
      class="facility"
      aria-label={`Facility data of ${anchor}`}
      onSubmit={(e) => {
        e.preventDefault();
        void save();
      }}
    >
      {FIELDS.map(([key, words, hint]) => (
        <label key={key}>
          <span class="lab">{words}</span>
          <input
            value={form[key]}
            placeholder={hint}
            maxLength={200}
            {...(key === 'ifc_guid' ? { pattern: IFC_GUID, title: IFC_WORDS } : {})}
            onInput={(e) => change({ [key]: e.currentTarget.value })}
          />
        </label>
      ))}
      <fieldset>
        <legend class="lab">Names in other systems</legend>
        {ids.map((e, i) => (
          <div class="pairrow" key={i}>
            <input
              required
              aria-label={`System ${i + 1}`}
              placeholder="Archibus"
              maxLength={60}
              value={e.system}
              onInput={(x) => set_id(i, { system: x.currentTarget.value })}
            />
            <input
              required
              aria-label={`Name in system ${i + 1}`}
              placeholder="its id there"
              maxLength={200}
              value={e.id}
              onInput={(x) => set_id(i, { id: x.currentTarget.value })}
            />
            <button
              type="button"
              class="btn"
              aria-label={`Remove system ${i + 1}`}
              onClick={() => change({ external_ids: ids.filter((_, k) => k !== i) })}
            >
              Remove
            </button>
          </div>
        ))}
        {ids.length < 32 && (
          <button
            type="button"
            class="btn small"
            onClick={() => change({ external_ids: [...ids, { system: '', id: '' }] })}
          >
            Add a system
          </button>
        )}
      </fieldset>
      <span class="actions">
        <button
          type="button"
          class="btn"
          onClick={() => {
            forget();
            close();
          }}
        >
          Cancel
        </button>
        <button class="btn primary" data-testid="facility-save" disabled={busy || same}>
          Save
        </button>
      </span>
    </form>
  );
}
