"""Systems of linear pieces with exact data: counts, pieces and transitions, proved."""
