/// Measurements: what one flight or campaign measured, filtered by the server, plotted and listed; a row opens its impulse response.
import { useState } from 'preact/hooks';
import '../desk.css';
import './measurements.css';
import { download_url } from '../../api/measurements';
import { may } from '../../state/session';
import { synced } from '../../state/store';
import { grouped } from '../../ui/format';
import { Empty, NotLoaded } from '../../ui/empty';
import { Icon } from '../../ui/marks';
import { CampaignMode } from './campaign_mode';
import { ExcludePanel } from './exclude';
import { Filters } from './filters';
import { ImpulsePanel } from './impulse';
import { HistogramPanel, LevelPanel, TruthPanel } from './plots';
import { RowList } from './row_list';
import { everything, useMeasurements, type Desk } from './use_measurements';
import { at_end } from './window';

const SCANNED = 20_000; ///< rows the server looks through for one page of a class

export function Measurements() {
  const desk = useMeasurements(),
    [labelling, set_labelling] = useState(false),
    [excluding, set_excluding] = useState(false);
  const { source, filter, problem, current, rows, n_known, drawn, sample, selected, close } = desk;
  return (
    <div class="desk measurements" data-testid="measurements">
      <Toolbar
        desk={desk}
        labelling={labelling}
        set_labelling={set_labelling}
        excluding={excluding}
        set_excluding={set_excluding}
      />
      {problem && (
        <div class="problem" role="status">
          <b>The measurements could not be read.</b> {problem}{' '}
          <button class="btn small" onClick={desk.read_again}>
            Try again
          </button>
        </div>
      )}
      <div class="page" tabIndex={0} role="region" aria-label="Measurements">
        {source && <Filters source={source} filter={filter} who={desk.who} set={desk.set_filter} />}
        {labelling && (
          <CampaignMode campaigns={desk.campaigns} close={() => set_labelling(false)} taken={desk.read_again} />
        )}
        {excluding && source?.kind === 'mission' && (
          <ExcludePanel mission={source.id} filter={filter} sample={sample} close={() => set_excluding(false)} />
        )}
        {!source && (
          <div class="empty small">
            <Empty cls="" loaded={synced.value && desk.campaigns_loaded}>
              Nothing has been measured yet. Ranges come with a flight, or as a campaign with known truth.
            </Empty>
            <span class="ways">
              <a class="btn" href="#/live">
                Go to Live
              </a>
              {may('operator') && (
                <a class="btn" href="#/import">
                  Import a flight
                </a>
              )}
            </span>
          </div>
        )}
        {source && !current && !problem && <NotLoaded cls="pad" />}
        {current && n_known === 0 && !at_end(rows) && rows.sizes.length > 0 && !problem && (
          <p class="pad" role="status">
            Searching further: none in the first {grouped(rows.sizes.length * SCANNED)}.
          </p>
        )}
        {current && at_end(rows) && n_known === 0 && (
          <div class="empty small">
            <p>
              {everything(filter)
                ? `${source!.name} has no measurements.`
                : 'No measurement passes this filter. Show all removes it.'}
            </p>
          </div>
        )}
        {sample && source && (
          <ImpulsePanel
            source={source}
            sample={sample}
            opened={desk.opened}
            all={desk.whole}
            close={close}
            step={desk.step}
          />
        )}
        {drawn.length > 0 && (
          <>
            <div class="plots">
              <LevelPanel samples={drawn} selected={selected} select={desk.open} />
              <TruthPanel samples={drawn} selected={selected} select={desk.open} />
              <HistogramPanel samples={drawn} />
            </div>
            {current!.every > 1 && (
              <p class="sub thinned" data-testid="thinned">
                The plots show {grouped(drawn.length)} of them, about one in {grouped(current!.every)}.
              </p>
            )}
          </>
        )}
        {n_known > 0 && (
          <RowList
            source={source!}
            rows={rows}
            selected={selected}
            at={desk.at}
            oldest_first={desk.oldest_first}
            select={desk.open}
            look={desk.look}
            turn={desk.turn}
          />
        )}
      </div>
    </div>
  );
}

function Toolbar({
  desk,
  labelling,
  set_labelling,
  excluding,
  set_excluding,
}: {
  desk: Desk;
  labelling: boolean;
  set_labelling: (on: boolean) => void;
  excluding: boolean;
  set_excluding: (on: boolean) => void;
}) {
  const { missions, campaigns, source, filter, count } = desk;
  return (
    <div class="toolbar">
      <h1>Measurements</h1>
      {source && (
        <select
          class="input"
          aria-label="Flight or campaign"
          data-testid="source"
          value={source?.id ?? ''}
          onChange={(e) => desk.choose(e.currentTarget.value)}
        >
          <optgroup label="Flights">
            {missions.map((s) => (
              <option key={s.id} value={s.id}>
                {s.name}
              </option>
            ))}
          </optgroup>
          {campaigns.length > 0 && (
            <optgroup label="Campaigns">
              {campaigns.map((s) => (
                <option key={s.id} value={s.id}>
                  {s.name}
                </option>
              ))}
            </optgroup>
          )}
        </select>
      )}
      <span class="mut" data-testid="counts" role="status">
        {count}
      </span>
      <span class="tools">
        {may('engineer', 'gateway') && (
          <button
            class="btn"
            data-testid="label-field"
            aria-expanded={labelling}
            onClick={() => set_labelling(!labelling)}
          >
            Label in the field
          </button>
        )}
        {source?.kind === 'mission' && (
          <button class="btn" data-testid="exclude" aria-expanded={excluding} onClick={() => set_excluding(!excluding)}>
            Out of use
          </button>
        )}
        {source &&
          (['csv', 'ndjson'] as const).map((format) => (
            <a
              key={format}
              class="btn"
              data-testid={`download-${format}`}
              href={download_url(source, filter, format)}
              download={`${source.kind === 'mission' ? 'ranges' : 'samples'}-${source.id}.${format}`}
            >
              <Icon name="download" />
              {format.toUpperCase()}
            </a>
          ))}
      </span>
    </div>
  );
}
