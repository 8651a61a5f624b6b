/** What the margin is called where limits and plots are kept by field and label. */
export const MARGIN = { field: 'balance', label: 'margin' } as const;
