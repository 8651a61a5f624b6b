/** The name of the margin where limits and plots are stored by field and label. */
export const MARGIN = { field: 'balance', label: 'margin' } as const;
