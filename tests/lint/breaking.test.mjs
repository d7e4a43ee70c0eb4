// Each kind of change that breaks a client is found by breaking.mjs and named; those that break nobody are not.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { breaking } from './breaking.mjs';

const document = () => ({
  paths: {
    '/things/{id}': {
      parameters: [{ $ref: '#/components/parameters/Id' }],
      get: {
        parameters: [{ name: 'sort', in: 'query', schema: { enum: ['name', 'age'] } }],
        responses: { 200: { $ref: '#/components/responses/Thing' }, 404: {} },
      },
      put: {
        requestBody: { content: { 'application/json': { schema: { $ref: '#/components/schemas/ThingIn' } } } },
        responses: { 200: { $ref: '#/components/responses/Thing' } },
      },
    },
  },
  components: {
    parameters: { Id: { name: 'id', in: 'path', required: true, schema: { type: 'string' } } },
    responses: { Thing: { content: { 'application/json': { schema: { $ref: '#/components/schemas/Thing' } } } } },
    schemas: {
      Named: { type: 'object', required: ['name'], properties: { name: { type: 'string' } } },
      Thing: {
        allOf: [
          { $ref: '#/components/schemas/Named' },
          {
            required: ['age_s'],
            properties: {
              age_s: { type: 'number' },
              parts: { type: 'array', items: { $ref: '#/components/schemas/Thing' } },
              place: { oneOf: [{ type: 'string' }, { type: 'null' }] },
            },
          },
        ],
      },
      ThingIn: {
        type: 'object',
        additionalProperties: false,
        properties: {
          kind: { enum: ['a', 'b'] },
          k: { type: 'integer', maximum: 10 },
          note: { type: ['string', 'null'] },
        },
      },
    },
  },
});
/** What is found after `change` of a copy. */
const found = (change) => {
  const now = document();
  change(now, now.components.schemas, now.paths['/things/{id}']);
  return breaking(document(), now);
};

for (const [what, change, expected] of [
  ['nothing', () => {}, []],
  [
    'a path that is gone',
    (d) => delete d.paths['/things/{id}'],
    ['GET /things/{id}: is gone', 'PUT /things/{id}: is gone'],
  ],
  ['a method that is gone', (d, s, p) => delete p.put, ['PUT /things/{id}: is gone']],
  [
    'an answer that is gone',
    (d, s, p) => (p.get.responses = { 204: {} }),
    ['GET /things/{id} 200: is no longer an answer'],
  ],
  ['a field of an answer that is gone', (d, s) => delete s.Thing.allOf[1].properties.age_s, ['Thing.age_s: is gone']],
  ['a field below allOf that is gone', (d, s) => delete s.Named.properties.name, ['Thing.name: is gone']],
  ['a field that may be absent', (d, s) => (s.Named.required = []), ['Thing.name: may be absent now']],
  [
    'a field of another type',
    (d, s) => (s.Named.properties.name.type = 'integer'),
    ['Thing.name: may be integer now, was string'],
  ],
  [
    'a field that may be null',
    (d, s) => (s.Named.properties.name.type = ['string', 'null']),
    ['Thing.name: may be null now, was string'],
  ],
  [
    'a form that is gone',
    (d, s) => (s.Thing.allOf[1].properties.place.oneOf[0].type = 'integer'),
    ['Thing.place: form 1 of 2 is not what it was'],
  ],
  ['a request field that is required', (d, s) => (s.ThingIn.required = ['k']), ['ThingIn.k: is required now']],
  [
    'a new request field that is required',
    (d, s) => Object.assign(s.ThingIn, { required: ['x'], properties: { ...s.ThingIn.properties, x: {} } }),
    ['ThingIn.x: is required now'],
  ],
  ['a request field that is gone', (d, s) => delete s.ThingIn.properties.k, ['ThingIn.k: is no longer taken']],
  ['a narrowed enum', (d, s) => s.ThingIn.properties.kind.enum.pop(), ['ThingIn.kind: no longer takes b']],
  ['a lower limit', (d, s) => (s.ThingIn.properties.k.maximum = 5), ['ThingIn.k: maximum is 5, was 10']],
  [
    'null that is no longer taken',
    (d, s) => (s.ThingIn.properties.note.type = 'string'),
    ['ThingIn.note: null is no longer taken'],
  ],
  [
    'a body that is required',
    (d, s, p) => (p.put.requestBody.required = true),
    ['PUT /things/{id} body: is required now'],
  ],
  [
    'a parameter that is gone',
    (d, s, p) => (p.get.parameters = []),
    ['GET /things/{id} query sort: is no longer taken'],
  ],
  [
    'a parameter that is required',
    (d, s, p) => p.get.parameters.push({ name: 'q', in: 'query', required: true, schema: {} }),
    ['GET /things/{id} query q: is required now'],
  ],
  ['a media type that is gone', (d) => (d.components.responses.Thing.content = { 'text/csv': {} }), undefined],
  // These break nobody.
  ['a new path', (d) => (d.paths['/others'] = { get: { responses: {} } }), []],
  [
    'another name of a part of the path',
    (d) => Object.assign(d.paths, { '/things/{thing}': d.paths['/things/{id}'] }),
    [],
  ],
  ['a new field of an answer', (d, s) => (s.Named.properties.colour = { type: 'string' }), []],
  ['a field that is sure to come now', (d, s) => s.Thing.allOf[1].required.push('parts'), []],
  ['a whole number where a number came', (d, s) => (s.Thing.allOf[1].properties.age_s.type = 'integer'), []],
  ['a new request field', (d, s) => (s.ThingIn.properties.x = { type: 'string' }), []],
  ['a wider enum', (d, s) => s.ThingIn.properties.kind.enum.push('c'), []],
  ['a number where a whole number was sent', (d, s) => (s.ThingIn.properties.k.type = 'number'), []],
  ['a higher limit', (d, s) => (s.ThingIn.properties.k.maximum = 20), []],
])
  test(`breaking.mjs: ${what}`, () => {
    const all = found(change);
    if (expected) assert.deepEqual(all, expected);
    else assert.notEqual(all.length, 0);
  });
