"""One start of `opamc nightly`: what there is and what is known, each night judged and recorded."""
