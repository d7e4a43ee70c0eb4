/// Organizations: whose sites these are, what each may store, and how much of it is used.
import { useState } from 'preact/hooks';
import { error_text } from '../../api/client';
import {
  create_organization,
  move_site,
  quota_of,
  remove_organization,
  rename_organization,
  set_limits,
  sites_of_all,
  type Organization,
  type Quota,
  type SiteOf,
} from '../../api/organizations';
import { organizations, read_organizations } from '../../state/organizations';
import { say } from '../../state/store';
import { Empty, NotLoaded, useLoad } from '../../ui/empty';
import { grouped } from '../../ui/format';
import { Chip } from '../../ui/marks';
import { Problem } from '../../ui/problem';
import { LIMITS, limits_of, typed_of, type Typed } from './limits';

export function OrganizationsPanel() {
  const [problem, set_problem] = useState(''),
    [name, set_name] = useState(''),
    [open, set_open] = useState('');
  const failed = (e: unknown): void => set_problem(error_text(e));
  const all = organizations.value;
  const load = (): void => {
    read_organizations().then(() => set_problem(''), failed);
  };
  useLoad(load);
  const create = (): void => {
    create_organization(name.trim()).then(() => {
      set_name('');
      load();
    }, failed);
  };
  return (
    <section class="sys-p" data-testid="organizations">
      <h2>Organizations</h2>
      <p class="sub">
        The sites of one customer, with limits of their own. A token that is made for an organization sees its sites and
        no others.
      </p>
      <Problem text={problem} />
      <form
        class="callout addform"
        onSubmit={(e) => {
          e.preventDefault();
          create();
        }}
      >
        <label class="grow">
          <span class="lab">Name</span>
          <input
            required
            maxLength={200}
            value={name}
            data-testid="organization-name"
            onInput={(e) => set_name(e.currentTarget.value)}
          />
        </label>
        <span class="actions">
          <button class="btn primary" data-testid="create-organization" disabled={!name.trim()}>
            Add
          </button>
        </span>
      </form>
      {all?.map((o) => (
        <div key={o.id} data-testid="organization">
          <div class="hd">
            <h3>{o.name}</h3>
            <button class="btn small" aria-expanded={open === o.id} onClick={() => set_open(open === o.id ? '' : o.id)}>
              {open === o.id ? 'Close' : 'Details'}
            </button>
          </div>
          {o.description && <p class="sub">{o.description}</p>}
          {open === o.id && (
            <Detail
              of={o}
              changed={load}
              removed={() => {
                set_open('');
                load();
              }}
            />
          )}
        </div>
      ))}
      {!all?.length && (
        <Empty loaded={all !== null} failed={problem !== ''}>
          There are none: the sites of this server are of no organization.
        </Empty>
      )}
    </section>
  );
}

function Detail({ of, changed, removed }: { of: Organization; changed: () => void; removed: () => void }) {
  const [quota, set_quota] = useState<Quota | null>(null),
    [sites, set_sites] = useState<readonly SiteOf[] | null>(null),
    [problem, set_problem] = useState(''),
    [editing, set_editing] = useState(false),
    [sure, set_sure] = useState(false);
  const load = (): void => {
    Promise.all([quota_of(of.id), sites_of_all()]).then(
      ([q, s]) => {
        set_quota(q);
        set_sites(s);
      },
      (e: unknown) => set_problem(error_text(e)),
    );
  };
  useLoad(load);
  const act = async (work: () => Promise<unknown>, words: string, then = load): Promise<boolean> => {
    set_problem('');
    try {
      await work();
    } catch (e) {
      set_problem(error_text(e));
      return false;
    }
    say(words);
    then();
    return true;
  };
  if (!quota || !sites)
    return (
      <>
        <Problem text={problem} />
        <NotLoaded failed={problem !== ''} />
      </>
    );
  const own = sites.filter((s) => s.organization === of.id);
  return (
    <div class="stack" data-testid="organization-detail">
      <Problem text={problem} />
      {editing ? (
        <LimitsForm
          of={of}
          quota={quota}
          close={() => set_editing(false)}
          save={async (name, description, limits) => {
            const saved = await act(async () => {
              if (name !== of.name || description !== of.description)
                await rename_organization(of.id, name, description);
              await set_limits(of.id, limits);
            }, `${name} saved`);
            changed();
            if (saved) set_editing(false);
          }}
        />
      ) : (
        <>
          <Use quota={quota} />
          <div class="actions">
            <button
              class="btn"
              disabled={own.length > 0}
              title={own.length > 0 ? 'It has sites: take them out first' : undefined}
              onClick={() => {
                if (!sure) set_sure(true);
                else {
                  set_sure(false);
                  void act(() => remove_organization(of.id), `${of.name} removed`, removed);
                }
              }}
            >
              {sure ? 'Press again to remove' : 'Remove'}
            </button>
            <button class="btn" data-testid="organization-edit" onClick={() => set_editing(true)}>
              Edit
            </button>
          </div>
        </>
      )}
      <Sites of={of} sites={sites} move={(site, to, words) => void act(() => move_site(site.id, to), words)} />
    </div>
  );
}

const Use = ({ quota: { limits, used, reached } }: { quota: Quota }) => (
  <dl class="kv" data-testid="organization-use">
    {LIMITS.map(([key, words]) => (
      <div key={key}>
        <dt>{words}</dt>
        <dd>
          {key === 'requests_per_minute' ? '' : grouped(used[key])}
          {limits[key] === null ? (
            <span class="mut"> no limit</span>
          ) : (
            `${key === 'requests_per_minute' ? 'at most' : ' of'} ${grouped(limits[key])}`
          )}{' '}
          {reached.some((r) => r === key) && <Chip shape="caution" tone="caution" word="REACHED" />}
        </dd>
      </div>
    ))}
  </dl>
);

function LimitsForm({
  of,
  quota,
  save,
  close,
}: {
  of: Organization;
  quota: Quota;
  save: (name: string, description: string | null, limits: Quota['limits']) => Promise<void>;
  close: () => void;
}) {
  const [name, set_name] = useState(of.name),
    [description, set_description] = useState(of.description ?? ''),
    [typed, set_typed] = useState<Typed>(typed_of(quota.limits)),
    [problem, set_problem] = useState('');
  return (
    <form
      class="callout"
      onSubmit={(e) => {
        e.preventDefault();
        const limits = limits_of(typed);
        if (typeof limits === 'string') return set_problem(limits);
        set_problem('');
        void save(name.trim(), description.trim() || null, limits);
      }}
    >
      <div class="addform">
        <label class="grow">
          <span class="lab">Name</span>
          <input required maxLength={200} value={name} onInput={(e) => set_name(e.currentTarget.value)} />
        </label>
        <label class="grow">
          <span class="lab">Description</span>
          <input maxLength={2000} value={description} onInput={(e) => set_description(e.currentTarget.value)} />
        </label>
        {LIMITS.map(([key, words]) => (
          <label key={key}>
            <span class="lab">{words}, at most</span>
            <input
              inputMode="numeric"
              placeholder="no limit"
              value={typed[key]}
              data-testid={`limit-${key}`}
              onInput={(e) => set_typed({ ...typed, [key]: e.currentTarget.value })}
            />
          </label>
        ))}
      </div>
      <p class="why">A limit below what is stored deletes nothing: nothing new is taken until there is room.</p>
      <Problem text={problem} />
      <div class="actions">
        <button type="button" class="btn" onClick={close}>
          Not now
        </button>
        <button class="btn primary" data-testid="organization-save" disabled={!name.trim()}>
          Save
        </button>
      </div>
    </form>
  );
}

function Sites({
  of,
  sites,
  move,
}: {
  of: Organization;
  sites: readonly SiteOf[];
  move: (site: SiteOf, to: string | null, words: string) => void;
}) {
  const [sure, set_sure] = useState(''),
    own = sites.filter((s) => s.organization === of.id),
    others = sites.filter((s) => s.organization !== of.id);
  return (
    <section data-testid="organization-sites">
      <h3>Sites</h3>
      {own.length === 0 && <p class="why">None yet.</p>}
      <ul class="plainlist">
        {own.map((s) => (
          <li key={s.id}>
            {s.name}{' '}
            <button
              class="btn small"
              onClick={() => {
                if (sure !== s.id) return set_sure(s.id);
                set_sure('');
                move(s, null, `${s.name} is of no organization now`);
              }}
            >
              {sure === s.id ? 'Press again: its tokens no longer see it' : 'Take out'}
            </button>
          </li>
        ))}
      </ul>
      {others.length > 0 && (
        <label>
          <span class="lab">Add a site</span>{' '}
          <select
            value=""
            data-testid="organization-add-site"
            onChange={(e) => {
              const site = others.find((s) => s.id === e.currentTarget.value);
              e.currentTarget.value = '';
              if (site) move(site, of.id, `${site.name} is of ${of.name} now`);
            }}
          >
            <option value="">choose</option>
            {others.map((s) => (
              <option key={s.id} value={s.id}>
                {s.name}
                {s.organization ? ' (of another organization)' : ''}
              </option>
            ))}
          </select>
        </label>
      )}
    </section>
  );
}
