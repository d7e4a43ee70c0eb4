// ESLint of the dashboard and of the JavaScript of tests/. Rules that find bugs; layout is Prettier's (.prettierrc.json).
//   node web/node_modules/eslint/bin/eslint.js --config web/eslint.config.js web tests     (from the project's root)
import { fileURLToPath } from 'node:url';
import js from '@eslint/js';
import hooks from 'eslint-plugin-react-hooks';
import globals from 'globals';
import typescript from 'typescript-eslint';

const unused = { args: 'after-used', argsIgnorePattern: '^_', varsIgnorePattern: '^_', caughtErrors: 'none' };

const message = 'use get, list, call, bytes or url of src/api/contract.ts: they are typed by api/openapi.yaml',
  DOORS = ['fetch', 'XMLHttpRequest', 'EventSource', 'WebSocket'].map((name) => ({ name, message })),
  HOLDERS = ['window', 'globalThis', 'self'];

export default typescript.config(
  // The client of the contract has its types from a file that its test generates, and the compiler there.
  { ignores: ['**/node_modules/', '**/generated/', '**/dist/', 'build/', '**/e2e/clients/'] },
  { linterOptions: { reportUnusedDisableDirectives: 'error', reportUnusedInlineConfigs: 'error' } },
  js.configs.recommended,
  {
    rules: {
      eqeqeq: ['error', 'always', { null: 'ignore' }], // x == null asks for null and undefined at once
      'no-unused-vars': ['error', unused],
      'no-sequences': ['error', { allowInParentheses: false }],
      'no-constant-binary-expression': 'error',
      'no-self-compare': 'error',
      'no-template-curly-in-string': 'error',
      'array-callback-return': 'error',
      // Prettier breaks code at 120; what it leaves, strings and comments, stays within these.
      'max-len': ['error', { code: 160, ignoreUrls: true }],
      'max-lines': ['error', 600],
    },
  },
  { files: ['**/*.mjs', '**/*.js', '**/vite*.config.ts'], languageOptions: { globals: globals.node } },
  // Functions of these run in the page.
  { files: ['**/e2e/*.mjs', '**/bench/*.mjs'], languageOptions: { globals: globals.browser } },
  {
    files: ['**/*.ts', '**/*.tsx'],
    extends: [typescript.configs.recommendedTypeCheckedOnly],
    plugins: { 'react-hooks': hooks },
    languageOptions: {
      globals: globals.browser,
      parserOptions: { project: './tsconfig.json', tsconfigRootDir: fileURLToPath(new URL('.', import.meta.url)) },
    },
    rules: {
      'no-undef': 'off', // the compiler's
      'no-unused-vars': 'off',
      '@typescript-eslint/no-unused-vars': ['error', unused],
      '@typescript-eslint/no-floating-promises': 'error',
      '@typescript-eslint/no-misused-promises': 'error',
      '@typescript-eslint/switch-exhaustiveness-check': 'error',
      // The hooks of Preact have React's names and React's rules.
      'react-hooks/rules-of-hooks': 'error',
      'react-hooks/exhaustive-deps': 'error',
    },
  },
  {
    // An element holds the picture that it was first a part of, and that one the pictures after it: kept outside a component, none of them is ever freed.
    files: ['**/src/**/*.tsx'],
    ignores: ['**/src/main.tsx'], // the page itself
    rules: {
      'no-restricted-syntax': [
        'error',
        {
          selector: ':matches(JSXElement, JSXFragment):not(:function *)',
          message: 'an element that is kept keeps every picture it was in: make it in a function',
        },
        {
          selector: 'JSXAttribute[name.name="type"] > Literal[value="number"]',
          message:
            'a browser says "" of a number with a comma, or drops the comma: a text field, and ui/typed_number.ts',
        },
      ],
    },
  },
  {
    // Whatever is asked of the server is held against its contract: there is no other way to it than src/api/contract.ts, and src/live for the stream.
    files: ['**/src/**/*.ts', '**/src/**/*.tsx'],
    ignores: ['**/src/api/contract.ts', '**/src/live/browser.ts'],
    rules: {
      'no-restricted-globals': ['error', ...DOORS],
      'no-restricted-properties': [
        'error',
        ...DOORS.flatMap((d) => HOLDERS.map((object) => ({ object, property: d.name, message: d.message }))),
      ],
    },
  },
);
